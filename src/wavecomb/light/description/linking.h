// SPDX-License-Identifier: Apache-2.0
/// Light and shadow linking: the sets of objects that collections of lights select.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "wavecomb/light/description/light_records.h"

namespace wavecomb {

class ObjectNames;

/// Returns a path without the numbers of point instances: "/Forest/Leaves" for
/// "/Forest[12]/Leaves".
std::string without_numbers(std::string_view path);

/// Rule of a collection for a path, as in UsdCollectionMembershipQuery.
enum class PathRule : uint8_t { kExclude, kExplicit, kExpand };

/// A set of objects, given by rules for prim paths. The rule of the nearest path among the object's
/// own path and its ancestors decides; kExplicit applies to its own path only.
struct GeometrySet {
  struct Entry {
    std::string path;
    PathRule rule;
  };
  std::vector<Entry> entries;  ///< ascending by path

  bool contains(std::string_view path) const;
};

/// Membership of all objects in all sets. Objects that belong to the same sets form a class.
struct SceneLinks {
  SceneLinks(const ObjectNames& names, std::span<const GeometrySet> sets);

  std::vector<uint32_t> classes;  ///< class of each object in the numbering of ObjectNames, from 1
  std::vector<uint32_t> members;  ///< for each class of objects, one bit for each set
  uint32_t words = 0;             ///< 32-bit words of `members` for each class

  LinkView view() const { return {classes.data(), members.data(), words}; }
};

}  // namespace wavecomb
