// SPDX-License-Identifier: Apache-2.0
/// Whether a partly present surface (cut-out) is there for a ray.
#pragma once

#include <cstdint>

#include "wavecomb/accel/embree_accelerator.h"
#include "wavecomb/scene/scene.h"

namespace wavecomb {

/// True where the material at barycentrics (u, v) of triangle `prim` is present for the path in
/// `slot`: always for opacity 1, never for 0, else by a random number keyed by (path, ray,
/// instance, triangle), so that traversal order and packet make-up cannot matter.
bool is_present(const SceneView& scene, uint32_t instance, uint32_t mesh, uint32_t prim, float u,
                float v, uint32_t slot, const PresenceKeys& keys);

/// Whether geometry `geom` of an instance is in the way of the shadow ray of a slot, by what the
/// keys say of linking.
bool casts_shadow(const SceneView& scene, uint32_t instance, uint32_t geom, uint32_t slot,
                  const PresenceKeys& keys);

}  // namespace wavecomb
