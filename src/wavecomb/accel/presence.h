// SPDX-License-Identifier: Apache-2.0
/// Whether a partly present surface (cut-out) is there for a ray.
#pragma once

#include <cstdint>
#include <vector>

#include "wavecomb/accel/embree_accelerator.h"
#include "wavecomb/scene/scene.h"

namespace wavecomb {

/// True where the material at barycentrics (u, v) of triangle `prim` is present for the path in
/// `slot`: always for opacity 1, never for 0, else by a random number keyed by (path, ray,
/// instance, triangle), so that traversal order and packet make-up cannot matter.
bool is_present(const SceneView& scene, uint32_t instance, uint32_t mesh, uint32_t prim, float u,
                float v, uint32_t slot, const PresenceKeys& keys);

/// By mesh: 1 where rays must ask whether they meet it: some of it may be partly present as some
/// instance wears it, or it is not in the way of every light.
std::vector<uint8_t> filtered_meshes(const Scene& scene);

/// By mesh: 1 for curves and points that are all hair, by whatever instance they are worn. What
/// goes on inside of a fibre is its BSDF's, so rays meet such meshes from outside alone.
std::vector<uint8_t> fibre_meshes(const Scene& scene);

/// Whether geometry `geom` of an instance is in the way of the shadow ray of a slot, by what the
/// keys say of linking.
bool casts_shadow(const SceneView& scene, uint32_t instance, uint32_t geom, uint32_t slot,
                  const PresenceKeys& keys);

/// Whether a mesh, as an instance shows it, is the object that the ray of a slot is for, or that
/// is for all.
inline bool is_of_object(const PresenceKeys& keys, uint32_t instance, uint32_t mesh,
                         uint32_t slot) {
  return !keys.object || keys.object[size_t{slot} * keys.stride] == object_of(instance, mesh);
}

/// Whether the ray of a slot meets triangle `prim` at (u, v): it is for that object, its kind sees
/// it, it is present, and for a shadow ray, in the way of its light.
bool is_met(const SceneView& scene, uint32_t instance, uint32_t geom, uint32_t mesh, uint32_t prim,
            float u, float v, uint32_t slot, const PresenceKeys& keys);

}  // namespace wavecomb
