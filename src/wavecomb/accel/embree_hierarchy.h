// SPDX-License-Identifier: Apache-2.0
/// Embree objects of an accelerator, which edited scenes share.
#pragma once

#include <embree4/rtcore.h>

#include <map>
#include <memory>
#include <vector>

#include "wavecomb/accel/embree_accelerator.h"
#include "wavecomb/accel/embree_curves.h"
#include "wavecomb/accel/light_shapes.h"

namespace wavecomb {

struct EmbreeDevice;

/// Embree geometries of meshes, scenes of groups, and the top-level scene with light shapes.
///
/// Contract: immutable. The hierarchy keeps the mesh arrays alive. The hierarchy depends on
/// materials only by the choice of meshes that need the presence filter; the filter reads the
/// materials of the traced scene.
class EmbreeHierarchy {
 public:
  /// `origin`: hierarchy of a scene with the same meshes, whose device, geometries and groups are
  /// shared if unchanged; may be null. `threads`: 0 uses all. Throws Error if Embree fails.
  EmbreeHierarchy(const Scene& scene, HitRule rule, const EmbreeHierarchy* origin,
                  uint32_t threads);
  ~EmbreeHierarchy();
  EmbreeHierarchy(const EmbreeHierarchy&) = delete;
  EmbreeHierarchy& operator=(const EmbreeHierarchy&) = delete;

  /// Returns whether this hierarchy can be used for `scene`, which must have the same geometry.
  bool fits(const Scene& scene) const;

  HitRule rule() const { return rule_; }
  RTCDevice device() const;
  RTCScene top() const { return top_; }
  /// Embree geometry id of the world's first mesh.
  uint32_t first_world() const { return first_world_; }
  uint32_t first_light() const { return first_light_; }  ///< Embree geometry id of light record 0
  /// Returns the memory of all hierarchies of the device in bytes.
  size_t bytes() const;

 private:
  void build(const EmbreeHierarchy* origin);
  void check(const char* operation) const;
  RTCScene new_scene() const;
  RTCGeometry make_mesh(uint32_t mesh_id);
  void attach_light(uint32_t id, const LightGeometry& shape) const;
  void release();

  std::shared_ptr<const SceneGeometry> geometry_;
  HitRule rule_;
  std::shared_ptr<EmbreeDevice> device_;
  std::vector<uint8_t> filtered_;      ///< result of filtered_meshes(), indexed by mesh
  std::vector<uint8_t> fibres_;        ///< result of fibre_meshes(), indexed by mesh
  std::vector<LightGeometry> shapes_;  ///< by light record
  RTCScene top_ = nullptr;
  std::vector<RTCScene> group_scenes_;
  std::vector<RTCGeometry> mesh_geometries_;
  /// Padded copies, by mesh, of vertex arrays that end at a page boundary.
  std::map<uint32_t, std::shared_ptr<const std::vector<float>>> padded_;
  std::map<uint32_t, std::shared_ptr<const CurveGeometry>> curves_;  ///< by mesh
  uint32_t first_world_ = 0, first_light_ = 0;
};

}  // namespace wavecomb
