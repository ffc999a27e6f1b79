// SPDX-License-Identifier: Apache-2.0
/// Loop over the stages of a wave.
#pragma once

#include "wavecomb/wave/stages/collect.h"
#include "wavecomb/wave/stages/generate.h"
#include "wavecomb/wave/stages/order.h"
#include "wavecomb/wave/stages/order_rays.h"
#include "wavecomb/wave/stages/resolve.h"
#include "wavecomb/wave/stages/shade.h"
#include "wavecomb/wave/stages/trace.h"

namespace wavecomb {

/// Additional stages of camera path waves for a joint transport (path/joint_transport.h). This
/// class is used in renders without a joint transport, and its functions do nothing.
struct NoJointStages {
  /// Begins a wave. An implementation may trace the light paths that the camera paths need.
  static void begin(Wave& /*wave*/, const WaveContext& /*context*/, const WaveTask& /*task*/) {}
  /// Processes the path vertices at `depth` after their shadow rays were traced.
  static void use_vertices(Wave& /*wave*/, const WaveContext& /*context*/, uint32_t /*depth*/) {}
  /// Ends a wave. At this point, the film contains the radiance of the wave.
  static void end(const Wave& /*wave*/, const WaveContext& /*context*/, const WaveTask& /*task*/) {}
};

/// Wave stages of camera paths. `Media` traces the paths through volumes and media.
template <typename F, typename Media, typename JointStages>
struct CameraPaths {
  const Media& media;
  const float* tfar = nullptr;  ///< far-plane distances of the camera rays

  void generate(Wave& wave, const WaveContext& context, const WaveTask& task) {
    tfar = wavecomb::generate<F>(wave, context, task);
    wave.counts.samples += task.path_count();
  }
  /// Returns whether to trace the camera rays as coherent packets. All rays of a pinhole camera
  /// start at the same point. For such rays, coherent packets find the same hits as single rays.
  /// For rays from several points, hits at edges may differ (canonical-hits.md).
  static bool are_coherent(const WaveContext& context) { return context.camera->is_pinhole(); }
  static PresenceKeys keys(const PathPool& pool, uint32_t depth) {
    return presence_keys(pool, depth, false);
  }
  static ShadeSettings settings(const WaveContext& context) {
    return ShadeSettings(*context.settings);
  }
  void collect(Wave& wave, const WaveContext& context, const ShadeSettings& settings,
               uint32_t depth) const {
    if constexpr (Media::kStreams)
      media.template sample_wave_flights<F>(wave, depth, settings.sampler);
    wavecomb::collect<F>(wave, context, settings, depth, media);
  }
  static const auto& kernels(const WaveContext& context, const ShadeSettings& settings) {
    return kernels_for<F, Media>(context, settings);
  }
  void shadow(Wave& wave, const WaveContext& context, uint32_t depth) const {
    wavecomb::shadow<F>(wave, context, depth, media);
  }
  static void use_vertices(Wave& wave, const WaveContext& context, uint32_t depth) {
    JointStages::use_vertices(wave, context, depth);
  }
  static void end_depth(Wave& wave, const WaveContext& context, const WaveTask& task,
                        uint32_t depth) {
    wave.events(context).end_depth(depth, task.path_count());
  }
  static void resolve(Wave& wave, const WaveContext& context, const WaveTask& task,
                      uint32_t depth) {
    wave.events(context).end_path(depth, task.path_count());
    if (context.histories) context.histories->ended(wave.history, wave.pool.radiance, task);
    if (context.discards) return;
    wavecomb::resolve(wave, context, task);
    JointStages::end(wave, context, task);
  }
};

/// Runs a wave to its end in lanes of type F: generate -> (trace -> collect -> order -> shade ->
/// shadow)* -> resolve.
template <typename F, typename Paths>
void run_stages(Wave& wave, const WaveContext& context, const WaveTask& task, Paths paths) {
  using Clock = PhaseClock::Clock;
  const Settings& s = *context.settings;
  const ShadeSettings settings = paths.settings(context);
  PhaseClock& clock = wave.clock;
  clock.start(Phase::kGenerate);
  paths.generate(wave, context, task);
  uint32_t depth = 0;
  for (; wave.rays.size > 0; ++depth) {
    RayOrderChoice ray_order;
    clock.enter(Phase::kTrace);
    if (depth > 0) {
      ray_order = order_rays<F>(wave, context, depth, s.ray_order, wave.ray_chooser,
                                wave.pool.paths, wave.rays);
      clock.enter(Phase::kTrace);
      fetch_rays<F>(wave);
    }
    Clock::time_point start = Clock::now();
    trace(wave, context, depth, depth == 0 ? paths.tfar : nullptr, fetch_times<F>(wave, wave.rays),
          depth == 0 && paths.are_coherent(context), paths.keys(wave.pool, depth));
    learn_order(wave.ray_chooser, depth, ray_order, start);

    clock.enter(Phase::kShade);
    paths.collect(wave, context, settings, depth);
    const OrderChoice choice = order_records<F>(wave, context, depth);
    clock.enter(Phase::kMetrics);
    watch_coherence<F>(wave, context);
    clock.enter(Phase::kShade);
    start = Clock::now();
    shade<F>(wave, context, settings, depth, paths.kernels(context, settings));
    if (choice.work.records > 0)
      wave.policy_chooser.learn(
          depth, choice.arm, choice.work,
          std::chrono::duration<double, std::nano>(Clock::now() - start).count(),
          choice.prepare_ns);
    compact<F>(wave);
    paths.end_depth(wave, context, task, depth);

    if (wave.shadows.size > 0) {
      const RayOrderChoice shadow_order =
          order_rays<F>(wave, context, depth, s.shadow_order, wave.shadow_chooser,
                        wave.pool.shadows, wave.shadows);
      clock.enter(Phase::kShadow);
      fetch_shadows<F>(wave);
      start = Clock::now();
      paths.shadow(wave, context, depth);
      learn_order(wave.shadow_chooser, depth, shadow_order, start);
    }
    paths.use_vertices(wave, context, depth);
  }
  clock.enter(Phase::kResolve);
  paths.resolve(wave, context, task, depth);
  clock.stop();
}

/// Runs a wave of camera paths in lanes of type F.
template <typename F, typename JointStages = NoJointStages, typename Media>
void run_wave_through(Wave& wave, const WaveContext& context, const WaveTask& task,
                      const Media& media) {
  JointStages::begin(wave, context, task);
  run_stages<F>(wave, context, task, CameraPaths<F, Media, JointStages>{media});
}

}  // namespace wavecomb
