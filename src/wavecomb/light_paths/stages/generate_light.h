// SPDX-License-Identifier: Apache-2.0
/// Wave stage 1 of light paths: starts a light path in every slot.
#pragma once

#include "wavecomb/light_paths/light_path_start.h"
#include "wavecomb/wave/stages/order_rays.h"
#include "wavecomb/wave/wave.h"

namespace wavecomb {

/// Starts a light path in each slot of the wave, and fills the ray queue with the paths for which a
/// light was sampled. A slot has the same pixel and sample as the camera path that generate() would
/// start in this slot.
template <typename F>
void generate_light(Wave& wave, const WaveContext& context, const WaveTask& task) {
  using U = UInt<F>;
  const Settings& settings = *context.settings;
  RayQueue& rays = wave.rays;
  const uint32_t n = task.path_count();
  const float inv_samples = 1.f / static_cast<float>(task.samples);
  size_t started = 0;
  wave.aovs.clear(n);
  for (uint32_t i = 0; i < n; i += kWidth<F>) {
    const Mask<F> active = first_lanes<F>(n - i);
    const U slot = lane_index<F>() + i;
    const U index = U(to_int<F>((F(Int<F>(slot)) + 0.5f) * inv_samples));  // as in generate()
    const U pixel = gather<U>(task.pixels, index, Mask<U>(active));
    const U sample = slot - index * task.samples + task.first_sample;
    const LightPath<F> path =
        begin_light_path<F>(context.scene.lights, settings, pixel, sample, active);
    if (context.moves())
      scatter_field<F>(wave.pool.cold, &PathColdRow<float>::time, slot,
                       light_path_time<F>(settings, path.key, pixel, sample), active);
    const Emission<F>& e = path.emission;
    store_row<LightPathRow, F>(wave.pool.paths, slot,
                               light_path_row<F>(path.start(), path.light_state(), path.key),
                               e.valid);
    if (wave.joint.aovs.wants_events()) [[unlikely]]
      wave.joint.aovs.begin<F>(slot, e.light, e.valid);
    const Mask<U> on(e.valid);
    compress_store<U>(rays.direction + started, direction_key<F>(e.d), on);
    started += compress_store<U>(rays.slot + started, slot, on);
  }
  rays.size = started;
}

}  // namespace wavecomb
