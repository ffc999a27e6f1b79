// SPDX-License-Identifier: Apache-2.0
/// Wave stage 4 of light paths: adds the contributions of vertices that the camera sees to the
/// film.
#pragma once

#include "wavecomb/light_paths/aiming/aim_samples.h"
#include "wavecomb/light_paths/light_path_start.h"
#include "wavecomb/wave/stages/trace.h"

namespace wavecomb {

/// Returns the film position (x, y), in pixels, of a light splat at the vertex at `depth` of the
/// path with sample key `key`.
inline LightSplatPoint light_splat_point(const SampleKey<float>& key, uint32_t depth, float x,
                                         float y) {
  const uint32_t path = path_hash<float>(key);
  return {x, y, hash_u32<uint32_t>(path, 0xb5297a4du + depth)};
}

/// Adds a contribution of light path sample `sample` to the sums of the pixels around `at`. The
/// sums are integers, so that the order of additions does not matter.
inline void add_light_splat(const WaveContext& context, LightSplatList& list, uint32_t sample,
                            const LightSplatPoint& at, const Color<float>& c) {
  Film& film = *context.film;
  context.joint.filter->spread(film, at, [&](size_t pixel, float weight) {
    const LightSplatList::LightSplat splat{static_cast<uint32_t>(pixel), c.x * weight, c.y * weight,
                                           c.z * weight, LightSplatLayer::is_in_half(sample)};
    film.collect(list, splat);
  });
}

/// Returns the light path number of the path in a slot of a wave.
inline uint32_t light_path_in(const WaveContext& context, const WaveTask& task, uint32_t slot) {
  return light_path_number(*context.settings, task.pixels[slot / task.samples]);
}

/// Stores the first hits of the light paths in a wave as training samples.
inline void record_first_hits(const Wave& wave, const WaveContext& context, const WaveTask& task) {
  const RayQueue& rays = wave.rays;
  for (size_t i = 0; i < rays.size; ++i) {
    if (wave.hits.inst[i] == kNoHit) continue;
    const Vec3<float> o{rays.ox[i], rays.oy[i], rays.oz[i]}, d{rays.dx[i], rays.dy[i], rays.dz[i]};
    context.joint.aim_samples->begin(light_path_in(context, task, rays.slot[i]),
                                     fma(d, wave.hits.t[i], o));
  }
}

/// Adds the finished light paths of a task to the film's count of light paths.
inline void count_light_paths(const WaveContext& context, const WaveTask& task) {
  if (context.joint.aim_samples) return;
  for (uint32_t p = 0; p < task.pixel_count; ++p)
    context.film->splats().done(light_path_number(*context.settings, task.pixels[p]),
                                task.first_sample, task.samples);
}

/// Tests which vertices of light paths the camera sees. Adds the contributions of visible vertices
/// to the film or, in training, to the training samples.
template <typename F>
void splat(Wave& wave, const WaveContext& context, const WaveTask& task, uint32_t depth) {
  const ShadowQueue& q = wave.shadows;
  occlude<F>(wave, context, depth, false);
  for (size_t i = 0; i < q.size; ++i) {
    if (q.occluded[i] != 0) continue;
    if (context.joint.aim_samples) [[unlikely]] {
      context.joint.aim_samples->add(light_path_in(context, task, q.slot[i]), depth,
                                     {q.r[i], q.g[i], q.b[i]});
      continue;
    }
    const auto row = load_row<ShadowRow, float>(wave.pool.shadows, q.slot[i], true);
    const auto path = load_row<LightPathRow, float>(wave.pool.paths, q.slot[i], true);
    const LightSplatPoint at = light_splat_point(path.key, depth, bits_float<float>(row.group),
                                                 bits_float<float>(row.set));
    const Color<float> c{q.r[i], q.g[i], q.b[i]};
    add_light_splat(context, wave.joint.splats, task.first_sample + q.slot[i] % task.samples, at,
                    c);
    if (wave.joint.aovs) [[unlikely]]
      wave.joint.aovs.add_to_film(
          *context.film, *context.joint.filter,
          {.slot = q.slot[i], .depth = depth, .light = path.light, .at = at, .c = c});
  }
  if (context.joint.aim_samples) return;
  context.film->take(wave.joint.splats);
}

}  // namespace wavecomb
