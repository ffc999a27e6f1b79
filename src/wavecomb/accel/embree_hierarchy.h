// SPDX-License-Identifier: Apache-2.0
/// Embree's side of an accelerator: what edited scenes share.
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

/// Geometries of meshes, scenes of groups, and the top level with the shapes of lights.
///
/// Contract: immutable. Keeps the arrays of meshes alive; knows no materials but which meshes ask
/// for the presence filter, which reads the materials of the scene that is traced.
class EmbreeHierarchy {
 public:
  /// `origin`: whose geometries and groups to share as far as they fit, with its device; or null.
  /// It must be of a scene with the same geometry. `threads`: 0: all. Throws Error when Embree
  /// refuses.
  EmbreeHierarchy(const Scene& scene, HitRule rule, const EmbreeHierarchy* origin,
                  uint32_t threads);
  ~EmbreeHierarchy();
  EmbreeHierarchy(const EmbreeHierarchy&) = delete;
  EmbreeHierarchy& operator=(const EmbreeHierarchy&) = delete;

  /// Whether it is what would be built for `scene`, which has the same geometry.
  bool fits(const Scene& scene) const;

  HitRule rule() const { return rule_; }
  RTCDevice device() const;
  RTCScene top() const { return top_; }
  uint32_t first_world() const { return first_world_; }  ///< geometry id of the world's first mesh
  uint32_t first_light() const { return first_light_; }  ///< geometry id of light record 0
  /// Memory that Embree holds, for all hierarchies of the device.
  size_t bytes() const;

 private:
  void build(const EmbreeHierarchy* origin);
  void check(const char* doing) const;
  RTCScene new_scene() const;
  RTCGeometry make_mesh(uint32_t mesh_id);
  void attach_light(uint32_t id, const PlacedShape& shape) const;
  void release();

  std::shared_ptr<const SceneGeometry> geometry_;
  HitRule rule_;
  std::shared_ptr<EmbreeDevice> device_;
  std::vector<uint8_t> filtered_;    ///< by mesh: some of it may be partly present
  std::vector<uint8_t> fibres_;      ///< by mesh: it is met from outside alone
  std::vector<PlacedShape> shapes_;  ///< by record
  RTCScene top_ = nullptr;
  std::vector<RTCScene> group_scenes_;
  std::vector<RTCGeometry> mesh_geometries_;
  /// By mesh: copies of arrays that end at a page boundary.
  std::map<uint32_t, std::shared_ptr<const std::vector<float>>> padded_;
  std::map<uint32_t, std::shared_ptr<const CurveGeometry>> curves_;  ///< by mesh
  uint32_t first_world_ = 0, first_light_ = 0;
};

}  // namespace wavecomb
