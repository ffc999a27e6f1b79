// SPDX-License-Identifier: Apache-2.0
/// Waves of light paths, and the stages that couple waves of camera paths to light paths.
#pragma once

#include "wavecomb/light_paths/stages/connect.h"
#include "wavecomb/light_paths/stages/generate_light.h"
#include "wavecomb/light_paths/stages/light_kernels.h"
#include "wavecomb/light_paths/stages/light_splat.h"
#include "wavecomb/wave/run_wave.h"

namespace wavecomb {

/// Wave stages that trace and shade light paths.
template <typename F>
struct LightPathStages {
  static constexpr const float* tfar = nullptr;
  const WaveTask* task = nullptr;

  void generate(Wave& wave, const WaveContext& context, const WaveTask& next_task) {
    task = &next_task;
    generate_light<F>(wave, context, next_task);
    fetch_rays<F>(wave);
  }
  static bool are_coherent(const WaveContext& /*context*/) { return false; }
  /// Light paths pass through lights that the camera does not see.
  static PresenceKeys keys(const PathPool& pool, uint32_t depth) {
    PresenceKeys keys = presence_keys(pool, depth, false);
    keys.bounce_pdf = nullptr;
    return keys;
  }
  static ShadeSettings settings(const WaveContext& context) {
    return light_shade_settings(*context.settings);
  }
  void collect(Wave& wave, const WaveContext& context, const ShadeSettings& settings,
               uint32_t depth) const {
    if (context.joint.aim_samples && depth == 0) [[unlikely]]
      record_first_hits(wave, context, *task);
    wavecomb::collect<F, NoMedia, true>(wave, context, settings, depth, NoMedia());
  }
  static const auto& kernels(const WaveContext& /*context*/, const ShadeSettings& /*settings*/) {
    return kShadeLightBatch;
  }
  void shadow(Wave& wave, const WaveContext& context, uint32_t depth) const {
    splat<F>(wave, context, *task, depth);
  }
  static void end_depth(Wave& /*wave*/, const WaveContext& /*context*/, const WaveTask& /*task*/,
                        uint32_t /*depth*/) {}
  static void use_vertices(Wave& /*wave*/, const WaveContext& /*context*/, uint32_t /*depth*/) {}
  static void resolve(Wave& wave, const WaveContext& context, const WaveTask& next_task,
                      uint32_t /*depth*/) {
    if (context.joint.merges()) context.film->take(wave.joint.splats);
    count_light_paths(context, next_task);
  }
};

/// Runs a wave of light paths in lanes of type F.
template <typename F>
void run_light_paths(Wave& wave, const WaveContext& context, const WaveTask& task) {
  run_stages<F>(wave, context, task, LightPathStages<F>());
}

/// Additional wave stages of camera paths in renders with light paths (the counterpart of
/// NoJointStages in wave/run_wave.h).
template <typename F>
struct LightPathJointStages {
  /// Traces the light paths that the camera paths of the task connect to.
  static void begin(Wave& wave, const WaveContext& context, const WaveTask& task) {
    LightPathBuffers& light = wave.joint;
    if (light.merge_points) light.merge_points.clear(task.path_count());
    if (!light.vertices) return;
    light.vertices.clear(task.path_count());
    light.use = LightVertexUse::kStore;
    run_light_paths<F>(wave, context, task);
    light.use = LightVertexUse::kToCamera;
  }
  /// Connects vertices of camera paths to vertices of light paths.
  static void use_vertices(Wave& wave, const WaveContext& context, uint32_t depth) {
    if (wave.joint.vertices) connect<F>(wave, context, depth);
  }
  /// Stores the merge point of each pixel. If a pixel has several samples, its last sample
  /// determines the merge point.
  static void end(const Wave& wave, const WaveContext& context, const WaveTask& task) {
    const MergePointRows& points = wave.joint.merge_points;
    if (!points) return;
    Film& film = *context.film;
    for (uint32_t i = 0; i < task.pixel_count; ++i)
      film.set_joint_row(film.index(task.pixels[i] & 0xffffu, task.pixels[i] >> 16),
                         points.row(size_t{i + 1} * task.samples - 1));
  }
};

}  // namespace wavecomb
