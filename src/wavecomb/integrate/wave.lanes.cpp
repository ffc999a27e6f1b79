// SPDX-License-Identifier: Apache-2.0
// Compiled once per lane width, with WAVECOMB_LANES set to it.
#include <bit>
#include <cstring>

#include "wavecomb/integrate/stages/collect.h"
#include "wavecomb/integrate/stages/generate.h"
#include "wavecomb/integrate/stages/order.h"
#include "wavecomb/integrate/stages/order_rays.h"
#include "wavecomb/integrate/stages/resolve.h"
#include "wavecomb/integrate/stages/shade.h"
#include "wavecomb/integrate/stages/trace.h"

namespace wavecomb {

// In shade_openpbr.lanes.cpp.
extern template void shade_batch<OpenPbrBsdf<Lanes<WAVECOMB_LANES>>, Lanes<WAVECOMB_LANES>>(
    Wave&, const WaveContext&, const ShadeSettings&, uint32_t, size_t, size_t);

template <size_t W>
void run_wave(Wave& wave, const WaveContext& context, const WaveTask& task) {
  using F = Lanes<W>;
  using Clock = PhaseClock::Clock;
  const Settings& s = *context.settings;
  const ShadeSettings settings(s);
  PhaseClock& clock = wave.clock;
  clock.start(Phase::kGenerate);
  const float* tfar = generate<F>(wave, context, task);
  wave.counts.samples += task.path_count();
  uint32_t depth = 0;
  for (; wave.rays.size > 0; ++depth) {
    // Camera rays of a pinhole are coherent as they come, and from one point packets give the same
    // hits as rays alone; from several, and on edges, they would not (canonical-hits.md).
    const bool coherent = depth == 0 && context.camera->is_pinhole();
    RayOrderChoice ray_order;
    clock.enter(Phase::kTrace);
    if (depth > 0) {
      ray_order = order_rays<F>(wave, context, depth, s.ray_order, wave.ray_chooser,
                                wave.pool.paths, wave.rays);
      clock.enter(Phase::kTrace);
      fetch_rays<F>(wave);
    }
    Clock::time_point start = Clock::now();
    trace(wave, context, depth, depth == 0 ? tfar : nullptr, fetch_times<F>(wave, wave.rays),
          coherent);
    learn_order(wave.ray_chooser, depth, ray_order, start);

    clock.enter(Phase::kShade);
    collect<F>(wave, context, settings, depth);
    const OrderChoice choice = order_records<F>(wave, context, depth);
    clock.enter(Phase::kMetrics);
    watch_coherence<F>(wave, context);
    clock.enter(Phase::kShade);
    start = Clock::now();
    shade<F>(wave, context, settings, depth);
    if (choice.work.records > 0)
      wave.policy_chooser.learn(
          depth, choice.arm, choice.work,
          std::chrono::duration<double, std::nano>(Clock::now() - start).count(),
          choice.prepare_ns);
    compact<F>(wave);
    wave.aovs.end_depth(depth, wave.pool.radiance, task.path_count());

    if (wave.shadows.size == 0) continue;
    const RayOrderChoice shadow_order = order_rays<F>(
        wave, context, depth, s.shadow_order, wave.shadow_chooser, wave.pool.shadows, wave.shadows);
    clock.enter(Phase::kShadow);
    fetch_shadows<F>(wave);
    start = Clock::now();
    shadow<F>(wave, context, depth);
    learn_order(wave.shadow_chooser, depth, shadow_order, start);
  }
  clock.enter(Phase::kResolve);
  wave.aovs.end_path(depth, wave.pool.radiance, task.path_count());
  resolve(wave, context, task);
  clock.stop();
}

/// Shades `records` synthetic hits of one material, to learn what it costs before the first pass.
/// Leaves nothing behind but the time, in nanoseconds.
template <size_t W>
double time_material(Wave& wave, const WaveContext& context, const CalibrationHits& hits) {
  using F = Lanes<W>;
  using Q = ShadingQueue;
  const ShadeSettings settings(*context.settings);
  ShadingQueue& queue = wave.shading;
  queue.clear();
  queue.size = hits.count;
  for (uint32_t i = 0; i < hits.count; ++i) {
    // Directions and places spread by the golden ratio; paths as after a first bounce.
    const float a = 0.61803399f * static_cast<float>(i), b = 0.75487767f * static_cast<float>(i);
    const float u = a - std::floor(a), v = b - std::floor(b);
    const Vec3<float> d = square_to_sphere(u, v);
    const CalibrationHit& hit = hits.hits[i % hits.distinct];
    store_row<ShadingRecord, float>(
        queue.row(0), i,
        {0.1f * context.scene.scale, 0.5f * u, 0.5f * v, hit.prim, hit.inst, hit.mesh, hit.geom, i},
        true);
    queue.uints(Q::kMaterial)[i] = hits.material;
    queue.uints(Q::kProgram)[i] = context.traits[hits.material].program;
    queue.slot[i] = i;
    const SampleKey<float> key{i * 0x9e3779b9u, i};
    store_row<PathRow, float>(wave.pool.paths, i,
                              {Vec3<float>(0.f), d, Color<float>(0.5f), 0.3f, 1.f,
                               0.01f * context.scene.scale, 0.f, key, 0u},
                              true);
    store_row<RadianceRow, float>(wave.pool.radiance, i, {}, true);
    if (wave.pool.cold) store_row<PathColdRow, float>(wave.pool.cold, i, {u, 0u}, true);
  }
  const auto start = PhaseClock::Clock::now();
  for (size_t begin = 0, batch = 1; begin < queue.size; ++batch) {
    // Packets that are to be filled in part only are batches of their own.
    const size_t end =
        hits.fill < 1.f
            ? std::min(queue.size,
                       static_cast<size_t>(hits.fill * static_cast<float>(W * batch) + 0.5f))
            : batch_end<F>(queue, begin);
    visit_program<F>(
        static_cast<ProgramId>(context.traits[hits.material].program),
        [&]<typename Bsdf>() { shade_batch<Bsdf, F>(wave, context, settings, 1, begin, end); });
    begin = end;
  }
  const auto stop = PhaseClock::Clock::now();
  wave.counts = {};
  return std::chrono::duration<double, std::nano>(stop - start).count();
}

template void run_wave<WAVECOMB_LANES>(Wave&, const WaveContext&, const WaveTask&);
template double time_material<WAVECOMB_LANES>(Wave&, const WaveContext&, const CalibrationHits&);

}  // namespace wavecomb
