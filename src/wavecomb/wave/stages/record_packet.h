// SPDX-License-Identifier: Apache-2.0
/// Packet of records of the shading queue, and the outcome of shading it.
#pragma once

#include "wavecomb/path/shading_record.h"
#include "wavecomb/wave/stages/order_rays.h"
#include "wavecomb/wave/wave.h"

namespace wavecomb {

/// Packet of shading records, in shading order, from index `i` to at most `end`.
template <typename F>
struct RecordPacket {
  using U = UInt<F>;
  Mask<F> active;
  U arrival;  ///< index of each record in arrival order; outcomes are stored at this index
  ShadingRecord<F> record;
  U material;

  RecordPacket(const ShadingQueue& queue, size_t i, size_t end) : active(first_lanes<F>(end - i)) {
    using Q = ShadingQueue;
    const U here = lane_index<F>() + static_cast<uint32_t>(i);
    arrival = queue.ordered || queue.moved ? load<U>(queue.sorted_indices + i) : here;
    const U at = queue.ordered ? arrival : here;
    record = load_row<ShadingRecord, F>(queue.row(0), at, active);
    material = queue.ordered ? gather<U>(queue.uints(Q::kMaterial), at, Mask<U>(active))
                             : load<U>(queue.uints(Q::kMaterial) + i);
  }

  /// Stores the shading outcomes. Paths in the lanes `alive` continue in direction `next`, and
  /// paths in the lanes `has_shadow` have a shadow ray in direction `shadow`.
  void store(const ShadingQueue& queue, const Mask<F>& alive, const Vec3<F>& next,
             const Mask<F>& has_shadow, const Vec3<F>& shadow) const {
    using Q = ShadingQueue;
    const U outcome = select(Mask<U>(alive), U(uint32_t{Q::kAlive}), U(0u)) |
                      select(Mask<U>(has_shadow), U(uint32_t{Q::kShadowRay}), U(0u)) |
                      (direction_key<F>(next) << Q::kRayKeyShift) |
                      (direction_key<F>(shadow) << Q::kShadowKeyShift);
    scatter<U>(queue.outcome, outcome, arrival, Mask<U>(active));
  }
};

}  // namespace wavecomb
