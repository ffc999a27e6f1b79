// SPDX-License-Identifier: Apache-2.0
/// Embree device, geometries and scenes of an accelerator. The accelerators of edited scenes share
/// them.
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

/// Embree objects of a scene: a geometry for each mesh, an Embree scene for each group, and the
/// top-level Embree scene, which also contains the shapes of lights.
///
/// Contract: the object is immutable and keeps the mesh arrays alive. Materials only determine
/// which meshes have a hit filter. The filter reads the materials of the scene in which rays are
/// traced.
class EmbreeHierarchy {
 public:
  /// Builds the hierarchy with up to `threads` threads; 0 means all threads. `origin` may be null.
  /// Otherwise, it is the hierarchy of a scene with the same meshes, and the new hierarchy shares
  /// its device and its unchanged geometries and groups. Throws `Error` if Embree fails.
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
  /// Embree geometry id of the first mesh of group 0, which is in world space.
  uint32_t first_world() const { return first_world_; }
  uint32_t first_light() const { return first_light_; }  ///< Embree geometry id of light record 0
  /// Returns the memory use in bytes of all hierarchies that share the device.
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
  /// Padded copies of vertex arrays that end at a page boundary, indexed by mesh.
  std::map<uint32_t, std::shared_ptr<const std::vector<float>>> padded_;
  std::map<uint32_t, std::shared_ptr<const CurveGeometry>> curves_;  ///< by mesh
  uint32_t first_world_ = 0, first_light_ = 0;
};

}  // namespace wavecomb
