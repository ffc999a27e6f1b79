// SPDX-License-Identifier: Apache-2.0
/// Presence of surfaces: the random decision whether a partially transparent surface stops a ray.
#pragma once

#include <cstdint>
#include <vector>

#include "wavecomb/accel/embree_accelerator.h"
#include "wavecomb/scene/scene_view.h"

namespace wavecomb {

class Scene;

/// Point on a primitive that the ray of a path may hit.
struct PresenceQuery {
  uint32_t instance;  ///< 0 for the world
  uint32_t geom;      ///< index of the geometry within the instance's group
  uint32_t mesh, prim;
  float u, v;         ///< position on the primitive; for triangles, barycentric coordinates
  uint32_t slot;      ///< slot of the path, an index into the arrays of `PresenceKeys`
  Vec3<float> dir{};  ///< direction of the ray
  float time = 0;     ///< shutter time of the ray
};

/// Returns whether a surface stops a ray. The surface stops all rays if its presence is 1 and it
/// does not transmit straight (material/lobes/straight_transmission.h), and none if its presence is
/// 0. Otherwise, the decision is random, with the probability presence * (1 - transmission). The
/// random number depends on the path, ray, instance and primitive, so that it depends neither on
/// packets nor on the order of traversal, and is stratified over the samples of a pixel. Shadow
/// rays with PresenceKeys::optical_depth pass surfaces that would stop only some rays. Does not
/// read `geom`.
bool is_present(const SceneView& scene, const PresenceQuery& at, const PresenceKeys& keys);

/// Returns one value per mesh: 1 if hits on the mesh must be filtered, else 0. Hits must be
/// filtered if the mesh may let rays pass by its opacity or is invisible to some rays in at least
/// one instance, bounds a medium, or consists of Gaussian splats, or if the scene has light
/// linking.
std::vector<uint8_t> filtered_meshes(const Scene& scene);

/// Returns one value per mesh: 1 for curves and points that have only hair materials in all
/// instances, else 0. A hair BSDF includes scattering inside the fibre, so rays hit such meshes
/// from outside only.
std::vector<uint8_t> fibre_meshes(const Scene& scene);

/// Returns whether light linking lets geometry `geom` of an instance block the shadow ray of a path
/// slot.
bool casts_shadow(const SceneView& scene, uint32_t instance, uint32_t geom, uint32_t slot,
                  const PresenceKeys& keys);

/// Returns whether the ray of a path slot may hit an instanced mesh: either the ray is not
/// restricted to one object, or the mesh is that object.
inline bool is_of_object(const PresenceKeys& keys, uint32_t instance, uint32_t mesh,
                         uint32_t slot) {
  return !keys.object || keys.object[size_t{slot} * keys.stride] == object_of(instance, mesh);
}

/// Returns whether the ray of a path slot hits the surface at a point. The ray must not be
/// restricted to another object, and the surface must be present and visible to this kind of ray.
/// For a shadow ray, the surface must also cast shadows from the ray's light.
bool accepts_hit(const SceneView& scene, const PresenceQuery& at, const PresenceKeys& keys);

}  // namespace wavecomb
