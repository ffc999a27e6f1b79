// SPDX-License-Identifier: Apache-2.0
/// Names of everything that is placed in a scene, made when they are asked for.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

namespace wavecomb {

class Scene;

/// Index of "no name" and of "no placement".
inline constexpr uint32_t kNoName = 0xffffffffu;

/// The name that a group's placement was given, and how much of it names the asset that it is part
/// of (0: none known).
struct PlacementName {
  std::string_view text;
  uint32_t asset_length = 0;
};

/// Many short texts in one block.
class NameTable {
 public:
  /// Index of the new entry.
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

/// One step on the way from the world to an instance.
struct Placement {
  uint32_t parent = kNoName;  ///< placement that this one is in; kNoName: the world
  uint32_t group = 0;         ///< what is placed
  uint32_t name = kNoName;    ///< in Scene's name table
  uint32_t number = kNoName;  ///< among those that share the name
};

/// What is known by a name: meshes, each placement of one apart, then lights, then volumes.
///
/// An object's name is its prim path as seen through its instances: "/World/Tree_7/Leaves", and
/// "/World/Forest[12]/Leaves" for a point instance. Its asset is the nearest model of kind
/// component that holds it; without one the outermost instance, or the prim below the stage's root
/// prim.
class ObjectNames {
 public:
  explicit ObjectNames(const Scene& scene);

  /// Objects are numbered instance by instance, mesh by mesh of the group, the world first; light
  /// records follow, then volumes.
  uint32_t count() const { return first_volume() + volume_count_; }
  /// First object of each instance of SceneView::instances.
  const std::vector<uint32_t>& first_object() const { return first_object_; }
  /// Object of light record 0.
  uint32_t first_light() const { return first_light_; }
  /// Object of volume 0.
  uint32_t first_volume() const { return first_light_ + light_count_; }

  std::string object(uint32_t index) const;
  std::string asset(uint32_t index) const;

 private:
  struct Found {
    uint32_t instance, mesh;
  };
  Found find(uint32_t index) const;
  std::string placement_name(uint32_t placement) const;
  /// Root of the group that a placement is in.
  std::string_view parent_root(const Placement& p) const;

  const Scene& scene_;
  std::vector<uint32_t> first_object_;
  std::vector<uint32_t> light_of_record_;
  uint32_t first_light_ = 0, light_count_ = 0, volume_count_ = 0;
};

}  // namespace wavecomb
