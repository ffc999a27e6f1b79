// SPDX-License-Identifier: Apache-2.0
// Compiled once per lane width, with WAVECOMB_LANES set to it.
#include "wavecomb/integrate/stages/collect.h"
#include "wavecomb/integrate/stages/generate.h"
#include "wavecomb/integrate/stages/order.h"
#include "wavecomb/integrate/stages/order_rays.h"
#include "wavecomb/integrate/stages/resolve.h"
#include "wavecomb/integrate/stages/shade.h"
#include "wavecomb/integrate/stages/trace.h"

namespace wavecomb {

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
  for (uint32_t depth = 0; wave.rays.size > 0; ++depth) {
    // Camera rays are coherent as they come.
    RayOrderChoice ray_order;
    if (depth > 0)
      ray_order = order_rays<F>(wave, context, depth, s.ray_order, wave.ray_chooser, wave.rays,
                                wave.other_rays);
    clock.enter(Phase::kTrace);
    Clock::time_point start = Clock::now();
    trace(wave, context, depth, depth == 0 ? tfar : nullptr);
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

    const RayOrderChoice shadow_order =
        order_rays<F>(wave, context, depth, s.shadow_order, wave.shadow_chooser, wave.shadows,
                      wave.other_shadows);
    clock.enter(Phase::kShadow);
    start = Clock::now();
    shadow<F>(wave, context, depth);
    learn_order(wave.shadow_chooser, depth, shadow_order, start);
  }
  clock.enter(Phase::kResolve);
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
    const float values[13] = {d.x,
                              d.y,
                              d.z,
                              0.5f,
                              0.5f,
                              0.5f,
                              0.3f,
                              1.f,
                              0.01f * context.scene.scale,
                              0.1f,
                              0.1f * context.scene.scale,
                              0.5f * u,
                              0.5f * v};
    for (uint32_t c = Q::kDx; c <= Q::kV; ++c)
      queue.floats(static_cast<Q::Column>(c))[i] = values[c];
    const CalibrationHit& hit = hits.hits[i % hits.distinct];
    queue.uints(Q::kSlot)[i] = i;
    queue.uints(Q::kInst)[i] = hit.inst;
    queue.uints(Q::kMesh)[i] = hit.mesh;
    queue.uints(Q::kGeom)[i] = hit.geom;
    queue.uints(Q::kPrim)[i] = hit.prim;
    queue.uints(Q::kMaterial)[i] = hits.material;
    queue.uints(Q::kProgram)[i] = context.traits[hits.material].program;
    queue.uints(Q::kArrival)[i] = i;
    wave.pool.pixel_hash[i] = i * 0x9e3779b9u;
    wave.pool.sample[i] = i;
    wave.pool.r[i] = wave.pool.g[i] = wave.pool.b[i] = 0.f;
  }
  const auto start = PhaseClock::Clock::now();
  for (size_t begin = 0; begin < queue.size;) {
    const size_t end = batch_end(queue, begin);
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
