// SPDX-License-Identifier: Apache-2.0
/// Loop over the stages of a wave.
#pragma once

#include "wavecomb/light_paths/stages/connect.h"
#include "wavecomb/light_paths/stages/generate_light.h"
#include "wavecomb/light_paths/stages/light_splat.h"
#include "wavecomb/wave/stages/collect.h"
#include "wavecomb/wave/stages/generate.h"
#include "wavecomb/wave/stages/order.h"
#include "wavecomb/wave/stages/order_rays.h"
#include "wavecomb/wave/stages/resolve.h"
#include "wavecomb/wave/stages/shade.h"
#include "wavecomb/wave/stages/trace.h"

namespace wavecomb {

/// Wave stages of camera paths, through the volumes and media of `Media`.
template <typename F, typename Media>
struct CameraPaths {
  const Media& media;
  const float* tfar = nullptr;  ///< far-plane distances of the camera rays

  void generate(Wave& wave, const WaveContext& context, const WaveTask& task) {
    tfar = wavecomb::generate<F>(wave, context, task);
    wave.counts.samples += task.path_count();
  }
  /// Returns whether to trace the camera rays as coherent packets. Rays of a pinhole camera start
  /// in one point, where packets give the same hits as single rays. Rays from several points would
  /// differ at edges (canonical-hits.md).
  static bool are_coherent(const WaveContext& context) { return context.camera->is_pinhole(); }
  static ShadeSettings settings(const WaveContext& context) {
    return camera_shade_settings(context);
  }
  void collect(Wave& wave, const WaveContext& context, const ShadeSettings& settings,
               uint32_t depth) const {
    if constexpr (Media::kStreams) media.template fly_all<F>(wave, depth, settings.sampler);
    wavecomb::collect<F>(wave, context, settings, depth, media);
  }
  static const auto& kernels(const WaveContext& context, const ShadeSettings& settings) {
    return kernels_for<F, Media>(context, settings);
  }
  void shadow(Wave& wave, const WaveContext& context, uint32_t depth) const {
    wavecomb::shadow<F>(wave, context, depth, media);
  }
  static void connect(Wave& wave, const WaveContext& context, uint32_t depth) {
    if constexpr (!Media::kAny)
      if (wave.light_vertices) wavecomb::connect<F>(wave, context, depth);
  }
  static void end_depth(Wave& wave, const WaveTask& task, uint32_t depth) {
    wave.aovs.end_depth(depth, wave.pool.radiance, task.path_count());
  }
  static void resolve(Wave& wave, const WaveContext& context, const WaveTask& task,
                      uint32_t depth) {
    wave.aovs.end_path(depth, wave.pool.radiance, task.path_count());
    if (wave.history) context.histories->ended(wave.history, wave.pool.radiance, task);
    if (!context.discards) wavecomb::resolve(wave, context, task);
  }
};

/// Wave stages of light paths.
template <typename F>
struct LightPaths {
  static constexpr const float* tfar = nullptr;
  const WaveTask* task = nullptr;

  void generate(Wave& wave, const WaveContext& context, const WaveTask& its_task) {
    task = &its_task;
    generate_light<F>(wave, context, its_task);
    fetch_rays<F>(wave);
  }
  static bool are_coherent(const WaveContext& /*context*/) { return false; }
  static ShadeSettings settings(const WaveContext& context) {
    return ShadeSettings(*context.settings).of_light_paths();
  }
  void collect(Wave& wave, const WaveContext& context, const ShadeSettings& settings,
               uint32_t depth) const {
    if (context.lessons && depth == 0) [[unlikely]]
      note_first_places(wave, context, *task);
    wavecomb::collect<F, NoMedia, true>(wave, context, settings, depth, NoMedia());
  }
  static const auto& kernels(const WaveContext& /*context*/, const ShadeSettings& /*settings*/) {
    return kShadeLightBatch;
  }
  void shadow(Wave& wave, const WaveContext& context, uint32_t depth) const {
    splat<F>(wave, context, *task, depth);
  }
  static void connect(Wave& /*wave*/, const WaveContext& /*context*/, uint32_t /*depth*/) {}
  static void end_depth(Wave& /*wave*/, const WaveTask& /*task*/, uint32_t /*depth*/) {}
  static void resolve(Wave& wave, const WaveContext& context, const WaveTask& its_task,
                      uint32_t /*depth*/) {
    if (context.merges()) context.film->take(wave.splats);
    count_light_paths(context, its_task);
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
          depth == 0 && paths.are_coherent(context));
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
    paths.end_depth(wave, task, depth);

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
    paths.connect(wave, context, depth);
  }
  clock.enter(Phase::kResolve);
  paths.resolve(wave, context, task, depth);
  clock.stop();
}

/// Traces the light paths whose vertices the camera paths of the task connect to.
template <typename F>
void run_connected_light(Wave& wave, const WaveContext& context, const WaveTask& task) {
  wave.light_vertices.clear(task.path_count());
  wave.light_use = Wave::LightUse::kKeep;
  run_stages<F>(wave, context, task, LightPaths<F>());
  wave.light_use = Wave::LightUse::kShow;
}

/// Runs a wave of camera paths in lanes of type F.
template <typename F, typename Media>
void run_wave_through(Wave& wave, const WaveContext& context, const WaveTask& task,
                      const Media& media) {
  run_stages<F>(wave, context, task, CameraPaths<F, Media>{media});
}

}  // namespace wavecomb
