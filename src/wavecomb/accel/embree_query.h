// SPDX-License-Identifier: Apache-2.0
/// What goes with a query through Embree to the functions that it calls back.
#pragma once

#include <embree4/rtcore.h>

#include "wavecomb/accel/embree_accelerator.h"

namespace wavecomb {

/// Handed through Embree to the filters: the rays' paths, and the closest hits so far of the
/// packet's rays. Packets are traced at widths that Embree has natively, so lane i there is lane i
/// here.
struct alignas(64) QueryContext {
  RTCRayQueryContext base;
  const SceneView* scene;  ///< whose materials say what is present
  const PresenceKeys* keys;
  const unsigned *inst, *geom, *prim;  ///< of the hits that Embree holds, W each
  alignas(64) float t[16];             ///< their true distances
};

/// Hits farther than the closest by less than this fraction are looked at still.
inline constexpr float kSlack = 1.f + 0x1p-20f;

}  // namespace wavecomb
