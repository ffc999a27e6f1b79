// SPDX-License-Identifier: Apache-2.0
/// Stage 2: what the rays hit. Stage 4: what the shadow rays meet.
#pragma once

#include "wavecomb/integrate/wave.h"

namespace wavecomb {

/// Keys of presence for rays of `depth`; shadow rays draw other numbers than the rays themselves.
inline PresenceKeys presence_keys(const PathPool& pool, uint32_t depth, bool shadow) {
  return {pool.pixel_hash, pool.sample, 2 * depth + (shadow ? 1u : 0u)};
}

/// Closest hits of the ray queue into the hit buffer.
inline void trace(Wave& wave, const WaveContext& context, uint32_t depth, const float* tfar) {
  const RayQueue& q = wave.rays;
  const RaySpan rays{q.ox, q.oy, q.oz, q.dx, q.dy, q.dz, tfar, q.slot, q.size};
  const HitBuffer& h = wave.hits;
  // Coherent packets assume rays from one point: with a lens, hits on edges would depend on the
  // packet.
  const bool coherent = depth == 0 && context.camera->lens_radius == 0;
  context.accel->intersect(rays, {h.t, h.u, h.v, h.prim, h.geom, h.inst}, context.traversal_width,
                           coherent, presence_keys(wave.pool, depth, false));
  wave.counts.add_rays(depth, q.size);
}

/// Adds what the unblocked shadow rays bring to their slots. A slot has at most one, so the order
/// of the queue cannot matter.
template <typename F>
void shadow(Wave& wave, const WaveContext& context, uint32_t depth) {
  using U = UInt<F>;
  ShadowQueue& q = wave.shadows;
  if (q.size == 0) return;
  const RaySpan rays{q.ox, q.oy, q.oz, q.dx, q.dy, q.dz, q.tfar, q.slot, q.size};
  uint32_t* occluded = q.alive;  // compaction is done with it
  context.accel->occluded(rays, occluded, context.traversal_width,
                          presence_keys(wave.pool, depth, true));
  for (size_t i = 0; i < q.size; i += kWidth<F>) {
    const Mask<F> active = first_lanes<F>(q.size - i) & Mask<F>(load<U>(occluded + i) == U(0u));
    const U slot = load<U>(q.slot + i);
    add_radiance<F>(wave.pool, slot, {load<F>(q.r + i), load<F>(q.g + i), load<F>(q.b + i)},
                    active);
  }
  wave.counts.add_shadow_rays(depth, q.size);
}

}  // namespace wavecomb
