// SPDX-License-Identifier: Apache-2.0
/// The loop of a wave, stage by stage.
#pragma once

#include "wavecomb/integrate/stages/collect.h"
#include "wavecomb/integrate/stages/generate.h"
#include "wavecomb/integrate/stages/order.h"
#include "wavecomb/integrate/stages/order_rays.h"
#include "wavecomb/integrate/stages/resolve.h"
#include "wavecomb/integrate/stages/shade.h"
#include "wavecomb/integrate/stages/trace.h"

namespace wavecomb {

/// Runs a wave to its end in lanes of type F: generate -> (trace -> collect -> order -> shade ->
/// shadow)* -> resolve.
template <typename F, typename Media>
void run_wave_through(Wave& wave, const WaveContext& context, const WaveTask& task,
                      const Media& media) {
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
    if constexpr (Media::kStreams) media.template fly_all<F>(wave, depth, settings.sampler);
    collect<F>(wave, context, settings, depth, media);
    const OrderChoice choice = order_records<F>(wave, context, depth);
    clock.enter(Phase::kMetrics);
    watch_coherence<F>(wave, context);
    clock.enter(Phase::kShade);
    start = Clock::now();
    shade<F, Media>(wave, context, settings, depth);
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
    shadow<F>(wave, context, depth, media);
    learn_order(wave.shadow_chooser, depth, shadow_order, start);
  }
  clock.enter(Phase::kResolve);
  wave.aovs.end_path(depth, wave.pool.radiance, task.path_count());
  if (wave.history) context.histories->ended(wave.history, wave.pool.radiance, task);
  if (!context.discards) resolve(wave, context, task);
  clock.stop();
}

}  // namespace wavecomb
