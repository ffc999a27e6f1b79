// SPDX-License-Identifier: Apache-2.0
/// Presence: whether a surface with partial opacity stops a ray.
#pragma once

#include <cstdint>
#include <vector>

#include "wavecomb/accel/embree_accelerator.h"
#include "wavecomb/scene/scene.h"

namespace wavecomb {

/// Point on a primitive that the ray of a path may hit.
struct PresenceQuery {
  uint32_t instance;  ///< 0 for the world
  uint32_t geom;      ///< geometry within the instance's group
  uint32_t mesh, prim;
  float u, v;     ///< position on the primitive: barycentrics of a triangle
  uint32_t slot;  ///< of the path
};

/// Returns whether the material is present: always for opacity 1, never for 0, otherwise by a
/// random number keyed by path, ray, instance and primitive, so that traversal order and packets
/// have no effect. Does not read `geom`.
bool is_present(const SceneView& scene, const PresenceQuery& at, const PresenceKeys& keys);

/// Returns, by mesh, 1 if hits must be filtered: the mesh may be partially present or invisible to
/// some rays in some instance, bounds a medium, is made of splats, or light linking is in use.
std::vector<uint8_t> filtered_meshes(const Scene& scene);

/// Returns, by mesh, 1 for curves and points with hair materials only, in all instances. The BSDF
/// models scattering inside the fibre, so rays hit such meshes from outside only.
std::vector<uint8_t> fibre_meshes(const Scene& scene);

/// Returns whether geometry `geom` of an instance casts a shadow on the shadow ray of a slot, by
/// the light linking in the keys.
bool casts_shadow(const SceneView& scene, uint32_t instance, uint32_t geom, uint32_t slot,
                  const PresenceKeys& keys);

/// Returns whether an instanced mesh is the object that the ray of a slot is restricted to, or the
/// ray is unrestricted.
inline bool is_of_object(const PresenceKeys& keys, uint32_t instance, uint32_t mesh,
                         uint32_t slot) {
  return !keys.object || keys.object[size_t{slot} * keys.stride] == object_of(instance, mesh);
}

/// Returns whether the ray of a slot hits the point: the object and ray visibility match, it is
/// present, and for shadow rays it casts a shadow from their light.
bool is_met(const SceneView& scene, const PresenceQuery& at, const PresenceKeys& keys);

}  // namespace wavecomb
