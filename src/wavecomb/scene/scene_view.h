// SPDX-License-Identifier: Apache-2.0
/// Device view of a scene, which kernels read.
#pragma once

#include <cstdint>

#include "wavecomb/geometry/mesh/motion.h"
#include "wavecomb/geometry/mesh/tangents.h"
#include "wavecomb/light/description/light_records.h"
#include "wavecomb/material/description/material.h"
#include "wavecomb/medium/description/mesh_medium.h"
#include "wavecomb/medium/description/subsurface.h"
#include "wavecomb/medium/description/volume.h"
#include "wavecomb/scene/visibility.h"

namespace wavecomb {

/// Packed instance; a record fills one cache line. Instance 0 is the world itself, with the
/// identity transform.
struct alignas(64) InstanceRecord {
  float to_world[12];  ///< 3 x 4 matrix [A | translation], row by row
  /// Index of the first entry of the instance's group in SceneView::geometry_mesh.
  uint32_t geometry;
  uint32_t material;  ///< material of the group's meshes whose material is kInheritMaterial
  /// Index of the instance's first entry in SceneView::emissive_lights, if any mesh emits.
  uint32_t emissive;
  float side;  ///< sign of det A; -1 for a mirroring transform
};
static_assert(sizeof(InstanceRecord) == 64);

/// Device view of a scene. The pointers are valid as long as the Scene exists.
struct SceneView {
  const MeshRecord* meshes = nullptr;
  const InstanceRecord* instances = nullptr;
  const TangentRecord* tangents = nullptr;  ///< indexed by mesh; null if no mesh has tangents
  /// mesh id of a geometry of an instance, at index `instance.geometry` + geometry id
  const uint32_t* geometry_mesh = nullptr;
  /// Light index of the first triangle of an emissive mesh instance, stored at index
  /// `instance.emissive` + geometry id.
  const uint32_t* emissive_lights = nullptr;
  /// Index of the light record of a mesh light, or kNoLight for other mesh instances. Indexed like
  /// `emissive_lights`. Null if the scene has no mesh lights.
  const uint32_t* mesh_lights = nullptr;
  /// RayVisibility bits of each mesh instance, indexed like `emissive_lights`. Null if every object
  /// is visible to all rays.
  const uint32_t* visibility = nullptr;
  const uint32_t* material_program = nullptr;
  const uint32_t* material_variant = nullptr;  ///< see variants.h
  MaterialView materials;
  LightView lights;
  MotionView motion;
  VolumeView volumes;
  SubsurfaceView subsurface;
  MeshMediaView nested_media;
  float scale = 1;  ///< radius of the bounding sphere
  bool has_presence = false;
  bool has_emissive_meshes = false;
  bool has_curves = false;  ///< whether some mesh consists of curves, points or splats
  bool has_motion = false;  ///< whether some mesh, instance or light moves while the shutter is
                            ///< open
};

}  // namespace wavecomb
