// SPDX-License-Identifier: Apache-2.0
/// Light and shadow linking: the sets of objects that the UsdLux collections of lights select.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "wavecomb/light/description/light_records.h"

namespace wavecomb {

class ObjectNames;

/// Returns a path without the indices of point instances: "/Forest/Leaves" for
/// "/Forest[12]/Leaves".
std::string without_numbers(std::string_view path);

/// Rule of a collection for a path, as in UsdCollectionMembershipQuery.
enum class PathRule : uint8_t { kExclude, kExplicit, kExpand };

/// Set of objects, defined by rules for prim paths. The rule for an object's path decides whether
/// the object is in the set. If there is none, the rule of the nearest ancestor with a rule
/// decides; kExplicit rules do not apply to descendants.
struct GeometrySet {
  struct Entry {
    std::string path;
    PathRule rule;
  };
  std::vector<Entry> entries;  ///< ascending by path

  bool contains(std::string_view path) const;
};

/// Membership of objects in the geometry sets. All objects that belong to the same sets form a
/// class.
struct SceneLinks {
  SceneLinks(const ObjectNames& names, std::span<const GeometrySet> sets);

  /// Class number (from 1) of each object, in the order of ObjectNames.
  std::vector<uint32_t> classes;
  std::vector<uint32_t> members;  ///< geometry sets that contain each class, one bit per set
  uint32_t words = 0;             ///< number of 32-bit words in `members` for each class

  LinkView view() const { return {classes.data(), members.data(), words}; }
};

}  // namespace wavecomb
