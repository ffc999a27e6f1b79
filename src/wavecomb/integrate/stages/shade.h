// SPDX-License-Identifier: Apache-2.0
/// Stage 3c: shading, batch by batch, in lanes.
#pragma once

#include "wavecomb/integrate/vertex.h"
#include "wavecomb/integrate/wave.h"

namespace wavecomb {

/// Shades records [begin, end) of the queue's order, all of program `Bsdf`, W at a time. New rays
/// and shadow rays go to the places of their records in arrival order; compact() closes the gaps.
template <typename Bsdf, typename F>
void shade_batch(Wave& wave, const WaveContext& context, const ShadeSettings& settings,
                 uint32_t depth, size_t begin, size_t end) {
  using U = UInt<F>;
  using Q = ShadingQueue;
  const ShadingQueue& queue = wave.shading;
  PathPool& pool = wave.pool;
  RayQueue& rays = wave.rays;
  ShadowQueue& shadows = wave.shadows;
  const bool wants_aovs = depth == 0 && pool.has_aovs;
  for (size_t i = begin; i < end; i += kWidth<F>) {
    const Mask<F> active = first_lanes<F>(end - i);
    const Mask<U> on(active);
    const U at = queue.ordered ? load<U>(queue.sorted_indices + i)
                               : lane_index<F>() + static_cast<uint32_t>(i);
    const auto real = [&](Q::Column c) {
      return queue.ordered ? gather<F>(queue.floats(c), at, active) : load<F>(queue.floats(c) + i);
    };
    const auto id = [&](Q::Column c) {
      return queue.ordered ? gather<U>(queue.uints(c), at, on) : load<U>(queue.uints(c) + i);
    };
    PathState<F> path;
    path.dir = {real(Q::kDx), real(Q::kDy), real(Q::kDz)};
    path.throughput = {real(Q::kThroughputR), real(Q::kThroughputG), real(Q::kThroughputB)};
    path.pdf = real(Q::kPdf);
    path.eta_scale = real(Q::kEtaScale);
    path.cone_width = real(Q::kConeWidth);
    path.cone_spread = real(Q::kConeSpread);
    const MeshHit<F> hit{id(Q::kInst), id(Q::kMesh), id(Q::kPrim), real(Q::kU), real(Q::kV)};
    const U slot = id(Q::kSlot);
    const U arrival = id(Q::kArrival);
    const SampleKey<F> key{gather<U>(pool.pixel_hash, slot, on), gather<U>(pool.sample, slot, on)};

    const VertexResult<F> v =
        shade_vertex<Bsdf, F>(context.scene, settings, key, depth, hit, id(Q::kGeom), real(Q::kT),
                              id(Q::kMaterial), path, wants_aovs, active);

    const Mask<F> emits = active & not_(is_black(v.emitted));
    if (any(emits)) add_radiance<F>(pool, slot, v.emitted, emits);
    if (wants_aovs) {
      scatter<F>(pool.albedo_r, v.albedo.x, slot, active);
      scatter<F>(pool.albedo_g, v.albedo.y, slot, active);
      scatter<F>(pool.albedo_b, v.albedo.z, slot, active);
      scatter<F>(pool.normal_x, v.normal.x, slot, active);
      scatter<F>(pool.normal_y, v.normal.y, slot, active);
      scatter<F>(pool.normal_z, v.normal.z, slot, active);
    }
    // Flags are set for every record, so nothing need be cleared before.
    scatter<U>(rays.alive, select(Mask<U>(v.alive), U(1u), U(0u)), arrival, on);
    scatter<U>(shadows.alive, select(Mask<U>(v.has_shadow), U(1u), U(0u)), arrival, on);
    const auto put = [&](float* to, const F& x, const Mask<F>& where) {
      scatter<F>(to, x, arrival, where);
    };
    if (any(v.has_shadow)) {
      const Mask<F>& m = v.has_shadow;
      put(shadows.ox, v.shadow_o.x, m);
      put(shadows.oy, v.shadow_o.y, m);
      put(shadows.oz, v.shadow_o.z, m);
      put(shadows.dx, v.shadow_d.x, m);
      put(shadows.dy, v.shadow_d.y, m);
      put(shadows.dz, v.shadow_d.z, m);
      put(shadows.tfar, v.shadow_tfar, m);
      put(shadows.r, v.direct.x, m);
      put(shadows.g, v.direct.y, m);
      put(shadows.b, v.direct.z, m);
      scatter<U>(shadows.slot, slot, arrival, Mask<U>(m));
    }
    if (any(v.alive)) {
      const Mask<F>& m = v.alive;
      put(rays.ox, v.o.x, m);
      put(rays.oy, v.o.y, m);
      put(rays.oz, v.o.z, m);
      put(rays.dx, v.next.dir.x, m);
      put(rays.dy, v.next.dir.y, m);
      put(rays.dz, v.next.dir.z, m);
      put(rays.throughput_r, v.next.throughput.x, m);
      put(rays.throughput_g, v.next.throughput.y, m);
      put(rays.throughput_b, v.next.throughput.z, m);
      put(rays.pdf, v.next.pdf, m);
      put(rays.eta_scale, v.next.eta_scale, m);
      put(rays.cone_width, v.next.cone_width, m);
      put(rays.cone_spread, v.next.cone_spread, m);
      scatter<U>(rays.slot, slot, arrival, Mask<U>(m));
    }
    ++wave.counts.packets;
    wave.counts.packet_lanes += kWidth<F>;
  }
}

/// Records in one batch at most: their columns stay in the first-level cache, and time is taken per
/// batch.
inline constexpr size_t kMaxBatch = 256;

/// End of the batch that starts at `begin`: a run of one program.
inline size_t batch_end(const ShadingQueue& queue, size_t begin) {
  const uint32_t* program = queue.uints(ShadingQueue::kProgram);
  const uint32_t* order = queue.ordered ? queue.sorted_indices : nullptr;
  const size_t limit = std::min(queue.size, begin + kMaxBatch);
  const uint32_t first = order ? program[order[begin]] : program[begin];
  size_t end = begin + 1;
  if (order)
    while (end < limit && program[order[end]] == first) ++end;
  else
    while (end < limit && program[end] == first) ++end;
  return end;
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

/// Shades the whole queue, batch by batch.
template <typename F>
void shade(Wave& wave, const WaveContext& context, const ShadeSettings& settings, uint32_t depth) {
  const ShadingQueue& queue = wave.shading;
  wave.costs.count({queue.uints(ShadingQueue::kMaterial), queue.size});
  for (size_t begin = 0; begin < queue.size;) {
    const size_t end = batch_end(queue, begin);
    const uint32_t at = queue.ordered ? queue.sorted_indices[begin] : static_cast<uint32_t>(begin);
    const auto program = static_cast<ProgramId>(queue.uints(ShadingQueue::kProgram)[at]);
    const bool timed = context.measures_costs && wave.costs.wants(end - begin);
    PhaseClock::Clock::time_point start;
    if (timed) start = PhaseClock::Clock::now();
    visit_program<F>(program, [&]<typename Bsdf>() {
      shade_batch<Bsdf, F>(wave, context, settings, depth, begin, end);
    });
    if (timed) charge_batch(wave, begin, end, start);
    begin = end;
  }
}

/// Closes the gaps that shading left in the ray and shadow queues, keeping order.
template <typename F>
void compact(Wave& wave) {
  using U = UInt<F>;
  const size_t n = wave.shading.size;
  const auto squeeze = [n](const uint32_t* alive, auto&& columns) {
    size_t out = 0;
    for (size_t i = 0; i < n; i += kWidth<F>) {
      const Mask<F> keep = first_lanes<F>(n - i) & Mask<F>(load<U>(alive + i) != U(0u));
      columns(i, out, keep);
      out += count<F>(keep);
    }
    return out;
  };
  RayQueue& r = wave.rays;
  r.size = squeeze(r.alive, [&](size_t from, size_t to, const Mask<F>& keep) {
    for (float* c : {r.ox, r.oy, r.oz, r.dx, r.dy, r.dz, r.throughput_r, r.throughput_g,
                     r.throughput_b, r.pdf, r.eta_scale, r.cone_width, r.cone_spread})
      compress_store<F>(c + to, load<F>(c + from), keep);
    compress_store<U>(r.slot + to, load<U>(r.slot + from), Mask<U>(keep));
  });
  ShadowQueue& s = wave.shadows;
  s.size = squeeze(s.alive, [&](size_t from, size_t to, const Mask<F>& keep) {
    for (float* c : {s.ox, s.oy, s.oz, s.dx, s.dy, s.dz, s.tfar, s.r, s.g, s.b})
      compress_store<F>(c + to, load<F>(c + from), keep);
    compress_store<U>(s.slot + to, load<U>(s.slot + from), Mask<U>(keep));
  });
}

}  // namespace wavecomb
