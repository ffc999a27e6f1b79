// SPDX-License-Identifier: Apache-2.0
/// Stage 3c: shading, batch by batch, in lanes.
#pragma once

#include "wavecomb/integrate/light_groups.h"
#include "wavecomb/integrate/stages/cost.h"
#include "wavecomb/integrate/stages/order_rays.h"
#include "wavecomb/integrate/vertex.h"
#include "wavecomb/integrate/wave.h"

namespace wavecomb {

/// Notes what guides a denoiser, of paths that have met clear surfaces only so far.
template <typename F>
void store_guides(const PathPool& pool, const UInt<F>& slot, const VertexAovs<F>& v,
                  const PathState<F>& path, const Mask<F>& active) {
  constexpr uint32_t kWords = PathPool::kGuideWords;
  const UInt<F> word = slot * kWords;
  const auto row = load_rows<kWords, F>(pool.guides, word, active);
  const Mask<F> seen = active & (row[6] == 0.f);
  if (none(seen)) return;
  const std::array<F, 6> g = guides_of<F>(v, path);
  store_rows<kWords, F>(
      pool.guides, word,
      {g[0], g[1], g[2], g[3], g[4], g[5], select(v.is_clear, F(0.f), F(1.f)), F(0.f)}, seen);
}

/// Shades records [begin, end) of the queue's order, all of program `Bsdf`, W at a time. A path's
/// next ray takes the place of its last in the pool; what became of it is noted by arrival.
template <typename Bsdf, typename F>
void shade_batch(Wave& wave, const WaveContext& context, const ShadeSettings& settings,
                 uint32_t depth, size_t begin, size_t end) {
  using U = UInt<F>;
  using Q = ShadingQueue;
  const ShadingQueue& queue = wave.shading;
  const PathPool& pool = wave.pool;
  const bool wants_first = depth == 0 && pool.first;
  VertexAovs<F> aovs;
  aovs.wants_uv = depth == 0 && pool.wants_uv;
  aovs.wants_lights = pool.groups != nullptr;
  aovs.uv = {F(0.f), F(0.f)};
  const bool wants_aovs = wants_first || pool.guides || pool.groups;
  for (size_t i = begin; i < end; i += kWidth<F>) {
    const Mask<F> active = first_lanes<F>(end - i);
    const Mask<U> on(active);
    const U here = lane_index<F>() + static_cast<uint32_t>(i);
    const U sorted = queue.ordered || queue.moved ? load<U>(queue.sorted_indices + i) : here;
    const U at = queue.ordered ? sorted : here;
    const auto r = load_rows<Q::kRowWords, F>(queue.rows(), at * uint32_t{Q::kRowWords}, active);
    const auto id = [&](Q::Word w) { return float_bits<F>(r[w]); };
    const U slot = id(Q::kSlot);
    const U material = queue.ordered ? gather<U>(queue.uints(Q::kMaterial), at, on)
                                     : load<U>(queue.uints(Q::kMaterial) + i);
    MeshHit<F> hit{id(Q::kInst), id(Q::kMesh), id(Q::kPrim), r[Q::kU], r[Q::kV]};
    if (context.scene.has_motion) [[unlikely]]
      hit.time = gather<F>(pool.time, slot, active);
    PathLanes<F> path = load_path<F>(pool, slot, active);
    const F t = r[Q::kT];
    PathState<F> state{path.d,
                       path.throughput,
                       path.pdf,
                       path.eta_scale,
                       fma(path.cone_spread, t, path.cone_width),
                       path.cone_spread,
                       path.o,
                       path.receiver};
    if (pool.link && context.scene.mesh_lights && depth > 0) [[unlikely]]
      state.link = gather<U>(pool.link, slot, on);
    const VertexResult<F> v =
        shade_vertex<Bsdf, F>(context.scene, settings, path.key, depth, hit, id(Q::kGeom), t,
                              material, state, wants_aovs ? &aovs : nullptr, active);

    const Mask<F> emits = active & not_(is_black(v.emitted));
    if (any(emits)) add_radiance<F>(pool, slot, v.emitted, emits);
    F lit_by(0.f);
    if (aovs.wants_lights) {
      const uint32_t* kept = context.aovs->kept_group.data();
      add_group_radiance<F>(pool, slot, kept_group<F>(kept, aovs.emitter, emits), v.emitted, emits);
      lit_by = bits_float<F>(kept_group<F>(kept, aovs.lit_by, v.has_shadow));
    }
    if (wants_first) {
      store_rows<PathPool::kFirstWords, F>(
          pool.first, slot * PathPool::kFirstWords,
          {aovs.albedo.x, aovs.albedo.y, aovs.albedo.z, aovs.normal.x, aovs.normal.y, aovs.normal.z,
           aovs.uv.x, aovs.uv.y},
          active);
    }
    if (pool.guides) store_guides<F>(pool, slot, aovs, state, active);
    const U outcome = select(Mask<U>(v.alive), U(uint32_t{Q::kAlive}), U(0u)) |
                      select(Mask<U>(v.has_shadow), U(uint32_t{Q::kShadowRay}), U(0u)) |
                      (direction_key<F>(v.next.dir) << Q::kRayKeyShift) |
                      (direction_key<F>(v.shadow_d) << Q::kShadowKeyShift);
    scatter<U>(queue.outcome, outcome, sorted, on);
    if (any(v.has_shadow)) {
      const F none(0.f);
      store_rows<PathPool::kShadowWords, F>(
          pool.shadows, slot * PathPool::kShadowWords,
          {v.shadow_o.x, v.shadow_o.y, v.shadow_o.z, v.shadow_d.x, v.shadow_d.y, v.shadow_d.z,
           v.shadow_tfar, v.direct.x, v.direct.y, v.direct.z, lit_by, bits_float<F>(v.shadow_set),
           none, none, none, none},
          v.has_shadow);
    }
    if (any(v.alive))
      store_path<F>(pool, slot,
                    {v.next.o, v.next.dir, v.next.throughput, v.next.pdf, v.next.eta_scale,
                     v.next.cone_width, v.next.cone_spread, path.key, v.next.receiver},
                    v.alive);
    if (pool.link) scatter<U>(pool.link, v.next.link, slot, Mask<U>(v.alive));
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
  spread_cost(wave.pool, end - begin, start, slot);
}

/// Shades the whole queue, batch by batch.
template <typename F>
void shade(Wave& wave, const WaveContext& context, const ShadeSettings& settings, uint32_t depth) {
  const ShadingQueue& queue = wave.shading;
  wave.costs.count({queue.uints(ShadingQueue::kMaterial), queue.size});
  for (size_t begin = 0; begin < queue.size;) {
    const size_t end = batch_end<F>(queue, begin);
    const uint32_t at = queue.ordered ? queue.sorted_indices[begin] : static_cast<uint32_t>(begin);
    const auto program = static_cast<ProgramId>(queue.uints(ShadingQueue::kProgram)[at]);
    const bool timed = context.measures_costs && wave.costs.wants(end - begin);
    PhaseClock::Clock::time_point start;
    if (timed || wave.pool.cost_ns) start = PhaseClock::Clock::now();
    visit_program<F>(program, [&]<typename Bsdf>() {
      shade_batch<Bsdf, F>(wave, context, settings, depth, begin, end);
    });
    if (timed) charge_batch(wave, begin, end, start);
    if (wave.pool.cost_ns) spread_batch(wave, begin, end, start);
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
