// SPDX-License-Identifier: Apache-2.0
/// Record of a hit or volume event that waits for shading.
#pragma once

#include "wavecomb/accel/embree_accelerator.h"
#include "wavecomb/core/rows/fields.h"

namespace wavecomb {

/// Value of ShadingRecord::inst for volume events, which have no surface. The value differs from
/// kNoHit and kLightShape; hits with those values have no ShadingRecord.
inline constexpr uint32_t kNoSurface = 0xfffffffdu;
static_assert(kNoSurface < kLightShape && kLightShape < kNoHit);

/// Hit or volume event of a path: a row of the ShadingQueue. The shading program in the queue's
/// program column distinguishes hits from volume events. If the program's kOnSurface is false, the
/// record is a volume event, which has only `t` and `slot`; its instance is kNoSurface and the
/// other words are 0.
template <typename F>
struct ShadingRecord {
  F t;     ///< length of the ray
  F u, v;  ///< position on the primitive, as in MeshHit
  UInt<F> prim, inst, mesh;
  UInt<F> geom;  ///< geometry within the instance's group
  UInt<F> slot;  ///< slot of the path
  WAVECOMB_FIELDS(t, u, v, prim, inst, mesh, geom, slot)

  /// Returns the record of a volume event.
  static ShadingRecord event(const F& t, const UInt<F>& slot) {
    const UInt<F> none(0u);
    return {t, F(0.f), F(0.f), none, UInt<F>(kNoSurface), none, none, slot};
  }
};

/// Returns the record `a` in the lanes of mask `m`, and `b` in all other lanes.
template <typename F>
inline ShadingRecord<F> select_record(const Mask<F>& m, const ShadingRecord<F>& a,
                                      const ShadingRecord<F>& b) {
  const Mask<UInt<F>> on(m);
  return {select(m, a.t, b.t),        select(m, a.u, b.u),        select(m, a.v, b.v),
          select(on, a.prim, b.prim), select(on, a.inst, b.inst), select(on, a.mesh, b.mesh),
          select(on, a.geom, b.geom), select(on, a.slot, b.slot)};
}

}  // namespace wavecomb
