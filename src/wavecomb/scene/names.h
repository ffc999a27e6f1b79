// SPDX-License-Identifier: Apache-2.0
/// Names of all objects of a scene, created on demand.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

namespace wavecomb {

class Scene;

/// Index value that means "no name" or "no placement".
inline constexpr uint32_t kNoName = 0xffffffffu;

/// Name of an instance of a group, and the length of the prefix that names its asset (0 if
/// unknown).
struct PlacementName {
  std::string_view text;
  uint32_t asset_length = 0;
};

/// Many short strings in one memory block.
class NameTable {
 public:
  /// Adds an entry and returns its index.
  uint32_t add(std::string_view text, uint32_t asset_length);
  PlacementName operator[](uint32_t i) const {
    const Entry& e = entries_[i];
    return {std::string_view(chars_).substr(e.begin, e.length), e.asset_length};
  }
  size_t bytes() const { return chars_.capacity() + entries_.capacity() * sizeof(Entry); }

 private:
  struct Entry {
    uint64_t begin;
    uint32_t length, asset_length;
  };
  std::string chars_;
  std::vector<Entry> entries_;
};

/// One level of nesting between the world and an instance.
struct Placement {
  /// index of the enclosing placement; kNoName if the world is the parent
  uint32_t parent = kNoName;
  uint32_t group = 0;         ///< the instanced group
  uint32_t name = kNoName;    ///< index into the name table of the scene
  uint32_t number = kNoName;  ///< number that distinguishes placements with the same name
};

/// Names of all objects of a scene: mesh instances, then lights, then volumes.
///
/// The name of an object is its prim path, in which the path of an instance replaces the path of
/// the prototype: "/World/Tree_7/Leaves", or "/World/Forest[12]/Leaves" for a point instance. The
/// asset of an object is the nearest enclosing model of kind component; if there is no such model,
/// the asset is the outermost instance or the prim below the stage's root prim.
class ObjectNames {
 public:
  explicit ObjectNames(const Scene& scene);

  /// Returns the number of objects. Objects are numbered instance by instance, starting with the
  /// world, and mesh by mesh within an instance. Light records follow, then volumes.
  uint32_t count() const { return first_volume() + volume_count_; }
  /// Returns the index of the first object of each instance in SceneView::instances.
  const std::vector<uint32_t>& first_object() const { return first_object_; }
  /// Returns the index of the object that belongs to the first light record.
  uint32_t first_light() const { return first_light_; }
  /// Returns the index of the object that belongs to the first volume.
  uint32_t first_volume() const { return first_light_ + light_count_; }

  std::string object(uint32_t index) const;
  std::string asset(uint32_t index) const;

 private:
  struct Found {
    uint32_t instance, mesh;
  };
  Found find(uint32_t index) const;
  std::string placement_name(uint32_t placement) const;
  /// Returns the root path of the group that contains a placement.
  std::string_view parent_root(const Placement& p) const;

  const Scene& scene_;
  std::vector<uint32_t> first_object_;
  std::vector<uint32_t> light_of_record_;
  uint32_t first_light_ = 0, light_count_ = 0, volume_count_ = 0;
};

}  // namespace wavecomb
