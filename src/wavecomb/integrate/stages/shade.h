// SPDX-License-Identifier: Apache-2.0
/// Stage 3c: shading, batch by batch, in lanes.
#pragma once

#include "wavecomb/integrate/media.h"
#include "wavecomb/integrate/shading_record.h"
#include "wavecomb/integrate/stages/order_rays.h"
#include "wavecomb/integrate/vertex.h"
#include "wavecomb/integrate/wave.h"

namespace wavecomb {

/// Shades records [begin, end) of the queue's order, all of program `Bsdf`, W at a time. A path's
/// next ray takes the place of its last in the pool; what became of it is noted by arrival.
template <typename Bsdf, typename F>
void shade_batch(Wave& wave, const WaveContext& context, const ShadeSettings& settings,
                 uint32_t depth, size_t begin, size_t end) {
  using U = UInt<F>;
  using Q = ShadingQueue;
  const ShadingQueue& queue = wave.shading;
  const PathPool& pool = wave.pool;
  VertexAovs<F> aovs = wave.aovs.template wanted<F>(depth);
  const bool wants_aovs = wave.aovs.wants_vertex(depth);
  const bool is_watched = wants_aovs || wave.history;
  for (size_t i = begin; i < end; i += kWidth<F>) {
    const Mask<F> active = first_lanes<F>(end - i);
    const Mask<U> on(active);
    const U here = lane_index<F>() + static_cast<uint32_t>(i);
    const U sorted = queue.ordered || queue.moved ? load<U>(queue.sorted_indices + i) : here;
    const U at = queue.ordered ? sorted : here;
    const auto r = load_row<ShadingRecord, F>(queue.row(0), at, active);
    const U slot = r.slot;
    const U material = queue.ordered ? gather<U>(queue.uints(Q::kMaterial), at, on)
                                     : load<U>(queue.uints(Q::kMaterial) + i);
    MeshHit<F> hit{r.inst, r.mesh, r.prim, r.u, r.v};
    if (context.scene.has_motion) [[unlikely]]
      hit.time = gather_field<F>(pool.cold, &PathColdRow<float>::time, slot, active);
    const auto path = load_row<PathRow, F>(pool.paths, slot, active);
    const F t = r.t;
    PathState<F> state{path.d,
                       path.throughput,
                       path.pdf,
                       path.eta_scale,
                       fma(path.cone_spread, t, path.cone_width),
                       path.cone_spread,
                       path.o,
                       path.receiver};
    if (context.links() && context.scene.mesh_lights && depth > 0) [[unlikely]]
      state.link = gather_field<F>(pool.cold, &PathColdRow<float>::link, slot, active);
    const VertexResult<F> v =
        shade_vertex<Bsdf, F>({context.scene, settings, path.key, depth, hit, r.geom, t, material,
                               state, wants_aovs ? &aovs : nullptr, active});

    const Mask<F> emits = active & not_(is_black(v.emitted));
    if (any(emits)) add_radiance<F>(pool.radiance, slot, v.emitted, emits);
    U lit_by(0u);
    if (aovs.wants_lights) {
      wave.aovs.template add<F>(slot, wave.aovs.template group_of<F>(aovs.emitter, emits),
                                v.emitted, emits);
      lit_by = wave.aovs.template group_of<F>(aovs.lit_by, v.has_shadow);
    }
    if (is_watched) {
      if (wants_aovs) wave.aovs.template vertex<F>(depth, slot, aovs, state, active);
      if (wave.history)
        wave.history.template vertex<F>(depth, slot, state, t, material, v, pool.radiance, active);
    }
    const U outcome = select(Mask<U>(v.alive), U(uint32_t{Q::kAlive}), U(0u)) |
                      select(Mask<U>(v.has_shadow), U(uint32_t{Q::kShadowRay}), U(0u)) |
                      (direction_key<F>(v.next.dir) << Q::kRayKeyShift) |
                      (direction_key<F>(v.shadow_d) << Q::kShadowKeyShift);
    scatter<U>(queue.outcome, outcome, sorted, on);
    if (any(v.has_shadow))
      store_row<ShadowRow, F>(
          pool.shadows, slot,
          {v.shadow_o, v.shadow_d, v.shadow_tfar, v.direct, lit_by, v.shadow_set}, v.has_shadow);
    if (any(v.alive))
      store_row<PathRow, F>(pool.paths, slot,
                            {v.next.o, v.next.dir, v.next.throughput, v.next.pdf, v.next.eta_scale,
                             v.next.cone_width, v.next.cone_spread, path.key, v.next.receiver},
                            v.alive);
    if (context.links())
      scatter_field<F>(pool.cold, &PathColdRow<float>::link, slot, v.next.link, v.alive);
    ++wave.counts.packets;
    wave.counts.packet_lanes += kWidth<F>;
  }
}

/// Records in one batch at most: their columns stay in the first-level cache, and time is taken per
/// batch.
inline constexpr size_t kMaxBatch = 256;

/// End of the batch that starts at `begin`: a run of one program.
template <typename F>
size_t batch_end(const ShadingQueue& queue, size_t begin) {
  using U = UInt<F>;
  const uint32_t* program = queue.uints(ShadingQueue::kProgram);
  const size_t limit = std::min(queue.size, begin + kMaxBatch);
  const U first(program[queue.ordered ? queue.sorted_indices[begin] : begin]);
  for (size_t i = begin; i < limit; i += kWidth<F>) {
    const Mask<U> active(first_lanes<F>(limit - i));
    const U here = queue.ordered ? gather<U>(program, load<U>(queue.sorted_indices + i), active)
                                 : load<U>(program + i);
    const uint32_t other = lane_bits<F>(Mask<F>(here != first) & Mask<F>(active));
    if (other != 0) return i + static_cast<size_t>(std::countr_zero(other));
  }
  return limit;
}

/// Charges a batch's time to the materials of its records.
inline void charge_batch(Wave& wave, size_t begin, size_t end,
                         PhaseClock::Clock::time_point start) {
  const double ns =
      std::chrono::duration<double, std::nano>(PhaseClock::Clock::now() - start).count();
  const ShadingQueue& queue = wave.shading;
  const uint32_t* material = queue.uints(ShadingQueue::kMaterial);
  std::array<uint32_t, kMaxBatch> materials;
  for (size_t i = begin; i < end; ++i)
    materials[i - begin] = material[queue.ordered ? queue.sorted_indices[i] : i];
  wave.costs.charge({materials.data(), end - begin}, ns);
}

/// Spreads a batch's time over the paths of its records, for the cost AOV.
inline void spread_batch(Wave& wave, size_t begin, size_t end,
                         PhaseClock::Clock::time_point start) {
  const ShadingQueue& queue = wave.shading;
  const auto slot = [&](size_t i) {
    return queue.slot[queue.ordered || queue.moved ? queue.sorted_indices[begin + i] : begin + i];
  };
  wave.aovs.spread_cost(end - begin, start, slot);
}

/// Shades the whole queue, batch by batch.
template <typename F, typename Media>
void shade(Wave& wave, const WaveContext& context, const ShadeSettings& settings, uint32_t depth) {
  const ShadingQueue& queue = wave.shading;
  wave.costs.count({queue.uints(ShadingQueue::kMaterial), queue.size});
  for (size_t begin = 0; begin < queue.size;) {
    const size_t end = batch_end<F>(queue, begin);
    const uint32_t at = queue.ordered ? queue.sorted_indices[begin] : static_cast<uint32_t>(begin);
    const auto program = static_cast<ProgramId>(queue.uints(ShadingQueue::kProgram)[at]);
    const bool timed = context.measures_costs && wave.costs.wants(end - begin);
    PhaseClock::Clock::time_point start;
    if (timed || wave.aovs.wants_cost()) start = PhaseClock::Clock::now();
    visit_list(typename Media::template Programs<F>{}, program, [&]<typename Bsdf>() {
      shade_batch<Bsdf, F>(wave, context, settings, depth, begin, end);
    });
    if (timed) charge_batch(wave, begin, end, start);
    if (wave.aovs.wants_cost()) spread_batch(wave, begin, end, start);
    begin = end;
  }
}

/// Lists the paths that go on and the shadow rays, both in arrival order.
template <typename F>
void compact(Wave& wave) {
  using U = UInt<F>;
  const ShadingQueue& queue = wave.shading;
  size_t rays = 0, shadows = 0;
  for (size_t i = 0; i < queue.size; i += kWidth<F>) {
    const Mask<U> active(first_lanes<F>(queue.size - i));
    const U outcome = load<U>(queue.outcome + i), slot = load<U>(queue.slot + i);
    const auto keep = [&](auto& list, size_t& n, ShadingQueue::Outcome what, uint32_t shift) {
      const Mask<U> wanted = active & Mask<U>((outcome & uint32_t{what}) != U(0u));
      compress_store<U>(list.direction + n, (outcome >> shift) & (kDirectionKeys - 1), wanted);
      n += compress_store<U>(list.slot + n, slot, wanted);
    };
    keep(wave.rays, rays, ShadingQueue::kAlive, ShadingQueue::kRayKeyShift);
    keep(wave.shadows, shadows, ShadingQueue::kShadowRay, ShadingQueue::kShadowKeyShift);
  }
  wave.rays.size = rays;
  wave.shadows.size = shadows;
}

}  // namespace wavecomb
