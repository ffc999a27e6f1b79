// SPDX-License-Identifier: Apache-2.0
/// Wave stage 3b: orders the shading queue by the scheduling policy.
#pragma once

#include "wavecomb/core/encoding/morton.h"
#include "wavecomb/core/math.h"
#include "wavecomb/core/rows/fields.h"
#include "wavecomb/core/settings.h"
#include "wavecomb/geometry/hit/uv.h"
#include "wavecomb/material/description/variants.h"
#include "wavecomb/wave/wave.h"

namespace wavecomb {

/// Returns a key of the texture position that a record reads: UDIM tile (7 bits), mip level (4
/// bits), Morton code of uv on a 128 x 128 grid (14 bits). The key is an estimate: the mip level
/// uses the mean uv density of the mesh, and texture transforms are ignored.
template <typename F>
UInt<F> texture_key(const SceneView& scene, const MeshHit<F>& hit, const F& cone_width,
                    const Mask<F>& active) {
  using U = UInt<F>;
  const detail::MeshReader<F> mesh(scene.meshes, hit.mesh, active);
  const Mask<F> has_uv = active & Mask<F>((mesh.flags & (kUvsPerVertex | kUvsPerCorner)) != U(0u));
  const Vec2<F> uv = hit_uv<F>(scene.meshes, hit.mesh, hit.prim, hit.u, hit.v, has_uv);
  const auto within = [](const F& x) {
    return clamp(select(is_finite(x), x, F(0.f)), F(-1e6f), F(1e6f));
  };
  const F u = within(uv.x), v = within(uv.y);
  const F fu = floor(u), fv = floor(v);
  const U tile = (U(to_int<F>(fu)) + U(to_int<F>(fv)) * 10u) & 0x7fu;
  const U cell = morton_2<U>(U(to_int<F>(F((u - fu) * 128.f))) & 0x7fu,
                             U(to_int<F>(F((v - fv) * 128.f))) & 0x7fu);
  const F density = gather_member<F>(scene.meshes, &MeshRecord::uv_density, hit.mesh, active);
  // The exponent of the footprint width gives the mip level of a texture with 2^15 texels per side:
  // floor(log2(width)) + 15.
  const F width = clamp(F(cone_width * density), F(0x1p-15f), F(1.f));
  const U level = ((float_bits<F>(width) >> 23) - 112u) & 0xfu;
  return select(Mask<U>(has_uv), (tile << 18) | (level << 14) | cell, U(0u));
}

/// Computes the columns of ShadingQueueView that the QueueColumn bits in `wanted` select.
template <typename F>
void fill_columns(Wave& wave, const WaveContext& context, uint32_t wanted) {
  using U = UInt<F>;
  using Q = ShadingQueue;
  const ShadingQueue& queue = wave.shading;
  for (size_t i = 0; i < queue.size; i += kWidth<F>) {
    const Mask<F> active = first_lanes<F>(queue.size - i);
    if (wanted & kPositionColumn)
      store(wave.columns.uints(1) + i, load<U>(queue.uints(Q::kPositionKey) + i));
    const auto r = load_row<ShadingRecord, F>(queue.row(0),
                                              lane_index<F>() + static_cast<uint32_t>(i), active);
    const auto path = load_row<PathRow, F>(wave.pool.paths, r.slot, active);
    if (wanted & kThroughputColumn) store(wave.columns.floats(0) + i, luminance(path.throughput));
    if (wanted & kTextureColumn) {
      const MeshHit<F> hit{r.inst, r.mesh, r.prim, r.u, r.v};
      const F width = fma(path.cone_spread, r.t, path.cone_width);
      const Mask<F> on_surface = active & Mask<F>(r.inst != U(kNoSurface));
      store(wave.columns.uints(2) + i, texture_key<F>(context.scene, hit, width, on_surface));
    }
  }
}

/// Number of packets that shading needs for a queue, if records are in arrival order and if records
/// are grouped by program.
struct PacketEstimate {
  double arrival = 0, grouped = 0;
};
inline PacketEstimate estimate_packets(std::span<const uint32_t> program, size_t width) {
  PacketEstimate e;
  std::array<uint32_t, kVariantCount> histogram{};
  size_t run = 0;
  for (size_t i = 0; i < program.size(); ++i) {
    ++histogram[program[i]];
    ++run;
    if (i + 1 == program.size() || program[i + 1] != program[i]) {
      e.arrival += static_cast<double>((run + width - 1) / width);
      run = 0;
    }
  }
  for (uint32_t n : histogram) e.grouped += static_cast<double>((n + width - 1) / width);
  return e;
}

/// Maximum number of scheduling policies among which a render can choose.
inline constexpr size_t kMaxPolicies = 16;

/// Scheduling policy of a shading queue, with the work and time that the policy chooser needs as
/// feedback.
struct OrderChoice {
  size_t arm = 0;  ///< index in WaveContext::policies
  Work work;
  double prepare_ns = 0;
};

/// Orders the shading queue: computes sort keys, sorts the indices, and moves the records. Measures
/// the time of each step separately.
template <typename F>
OrderChoice order_records(Wave& wave, const WaveContext& context, uint32_t depth) {
  using Clock = PhaseClock::Clock;
  ShadingQueue& queue = wave.shading;
  OrderChoice choice;
  if (queue.size < 2) return choice;
  wave.clock.enter(Phase::kKeys);
  const std::span<const uint32_t> program{queue.uints(ShadingQueue::kProgram), queue.size};
  const bool chooses = context.policies.size() > 1;
  Clock::time_point start;
  if (chooses) {
    start = Clock::now();
    const PacketEstimate packets = estimate_packets(program, kWidth<F>);
    std::array<Work, kMaxPolicies> work;
    const auto records = static_cast<double>(queue.size);
    for (size_t arm = 0; arm < context.policies.size(); ++arm)
      work[arm] = {context.policies[arm]->keeps_arrival_order() ? packets.arrival : packets.grouped,
                   records};
    choice.arm = wave.policy_chooser.choose(depth, {work.data(), context.policies.size()});
    choice.work = work[choice.arm];
  }
  const SchedulingPolicy& policy = *context.policies[choice.arm];
  const uint32_t wanted = policy.columns();
  if (wanted != 0) fill_columns<F>(wave, context, wanted);
  const auto column = [&](auto* data, QueueColumn c) {
    return std::span(static_cast<const std::remove_pointer_t<decltype(data)>*>(data),
                     (wanted & c) != 0 ? queue.size : 0);
  };
  const ShadingQueueView view{program,
                              {queue.uints(ShadingQueue::kMaterial), queue.size},
                              column(wave.columns.floats(0), kThroughputColumn),
                              column(wave.columns.uints(1), kPositionColumn),
                              column(wave.columns.uints(2), kTextureColumn),
                              context.traits,
                              wave.scratch,
                              depth};
  if (policy.order(view, *context.costs, {wave.sorter.keys(), queue.size})) {
    wave.clock.enter(Phase::kSort);
    queue.ordered = wave.sorter.sort(queue.size, queue.sorted_indices);
    if (queue.ordered && context.settings->materialize == Materialize::kOn) {
      wave.clock.enter(Phase::kMaterialize);
      queue.materialize();
    }
  }
  if (chooses)
    choice.prepare_ns = std::chrono::duration<double, std::nano>(Clock::now() - start).count();
  return choice;
}

/// Adds every seventeenth shading queue to the coherence statistics, with records in shading order.
/// The interval is a prime number, since waves with 8 or 16 depths would otherwise be measured
/// always at the same depth.
template <typename F>
void watch_coherence(Wave& wave, const WaveContext& context) {
  if (wave.queues % 17 != 1) return;
  const ShadingQueue& queue = wave.shading;
  fill_columns<F>(wave, context, kTextureColumn);
  measure_coherence(
      {queue.uints(ShadingQueue::kMaterial), queue.size}, {wave.columns.uints(2), queue.size},
      {queue.sorted_indices, queue.ordered ? queue.size : 0}, context.traits, wave.coherence);
}

}  // namespace wavecomb
