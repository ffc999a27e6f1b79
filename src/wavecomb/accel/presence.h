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
  uint32_t geom;      ///< index of the geometry within the instance's group
  uint32_t mesh, prim;
  float u, v;     ///< position on the primitive; for triangles, barycentric coordinates
  uint32_t slot;  ///< slot of the path
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

/// Returns whether geometry `geom` of an instance blocks the shadow ray of a path slot, given the
/// light linking in `keys`.
bool casts_shadow(const SceneView& scene, uint32_t instance, uint32_t geom, uint32_t slot,
                  const PresenceKeys& keys);

/// Returns whether the ray of a path slot may hit an instanced mesh: either the ray is not
/// restricted to one object, or the mesh is that object.
inline bool is_of_object(const PresenceKeys& keys, uint32_t instance, uint32_t mesh,
                         uint32_t slot) {
  return !keys.object || keys.object[size_t{slot} * keys.stride] == object_of(instance, mesh);
}

/// Returns whether the ray of a path slot hits the point: the ray may hit the point's object, the
/// surface is present and visible to this kind of ray, and for shadow rays it casts a shadow from
/// their light.
bool accepts_hit(const SceneView& scene, const PresenceQuery& at, const PresenceKeys& keys);

}  // namespace wavecomb
