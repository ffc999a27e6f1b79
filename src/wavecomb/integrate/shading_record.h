// SPDX-License-Identifier: Apache-2.0
/// What waits for shading.
#pragma once

#include "wavecomb/core/fields.h"

namespace wavecomb {

/// A hit of a path's ray: what a row of the ShadingQueue holds.
template <typename F>
struct ShadingRecord {
  F t;     ///< length of the ray
  F u, v;  ///< where on the primitive: MeshHit
  UInt<F> prim, inst, mesh;
  UInt<F> geom;  ///< geometry within the instance's group
  UInt<F> slot;  ///< of the path
  WAVECOMB_FIELDS(t, u, v, prim, inst, mesh, geom, slot)
};

}  // namespace wavecomb
