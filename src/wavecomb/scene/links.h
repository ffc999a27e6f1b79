// SPDX-License-Identifier: Apache-2.0
/// Light and shadow linking: which objects the collections of lights name.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "wavecomb/scene/light_data.h"

namespace wavecomb {

class ObjectNames;

/// The path without the numbers of point instances: "/Forest/Leaves" of "/Forest[12]/Leaves".
std::string without_numbers(std::string_view path);

/// What a path of a collection says, as UsdCollectionMembershipQuery's rules.
enum class PathRule : uint8_t { kExclude, kExplicit, kExpand };

/// A set of objects by their prim paths. Of an object's own path and those above it the nearest one
/// with a rule decides; kExplicit counts for the path itself alone.
struct GeometrySet {
  struct Entry {
    std::string path;
    PathRule rule;
  };
  std::vector<Entry> entries;  ///< ascending by path

  bool contains(std::string_view path) const;
};

/// Membership of all objects in all sets: objects in the same ones are a class.
struct SceneLinks {
  SceneLinks(const ObjectNames& names, std::span<const GeometrySet> sets);

  std::vector<uint32_t> classes;  ///< by object as ObjectNames numbers them, from 1
  std::vector<uint32_t> members;  ///< for each class a bit for each set
  uint32_t words = 0;             ///< of members, for each class

  LinkView view() const { return {classes.data(), members.data(), words}; }
};

}  // namespace wavecomb
