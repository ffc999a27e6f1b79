// SPDX-License-Identifier: Apache-2.0
/// What waits for shading.
#pragma once

#include "wavecomb/accel/embree_accelerator.h"
#include "wavecomb/core/fields.h"

namespace wavecomb {

/// Instance of a record that is no hit; neither kNoHit nor kLightShape, of which there are no
/// records.
inline constexpr uint32_t kNoSurface = 0xfffffffdu;
static_assert(kNoSurface < kLightShape && kLightShape < kNoHit);

/// What a path has met: what a row of the ShadingQueue holds. The program that shades it, which is
/// in a column of the queue, says what kind of event that is: the hit of a surface, or, where its
/// kOnSurface is false, an event on the way, of which there is `t` and `slot`; its instance is
/// kNoSurface and the other words are 0.
template <typename F>
struct ShadingRecord {
  F t;     ///< length of the ray
  F u, v;  ///< where on the primitive: MeshHit
  UInt<F> prim, inst, mesh;
  UInt<F> geom;  ///< geometry within the instance's group
  UInt<F> slot;  ///< of the path
  WAVECOMB_FIELDS(t, u, v, prim, inst, mesh, geom, slot)

  /// The record of an event on the way.
  static ShadingRecord event(const F& t, const UInt<F>& slot) {
    const UInt<F> none(0u);
    return {t, F(0.f), F(0.f), none, UInt<F>(kNoSurface), none, none, slot};
  }
};

/// `a` where `m`, else `b`.
template <typename F>
inline ShadingRecord<F> select_record(const Mask<F>& m, const ShadingRecord<F>& a,
                                      const ShadingRecord<F>& b) {
  const Mask<UInt<F>> on(m);
  return {select(m, a.t, b.t),        select(m, a.u, b.u),        select(m, a.v, b.v),
          select(on, a.prim, b.prim), select(on, a.inst, b.inst), select(on, a.mesh, b.mesh),
          select(on, a.geom, b.geom), select(on, a.slot, b.slot)};
}

}  // namespace wavecomb
