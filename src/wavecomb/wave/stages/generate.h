// SPDX-License-Identifier: Apache-2.0
/// Wave stage 1: generates a camera ray for every slot.
#pragma once

#include "wavecomb/guiding/lookup.h"
#include "wavecomb/wave/wave.h"

namespace wavecomb {

/// Fills the path pool and the ray queue. The slot of a path is (index of its pixel in the task) *
/// samples + sample. Returns the column of far-plane distances, or null if the camera has no far
/// plane.
template <typename F>
const float* generate(Wave& wave, const WaveContext& context, const WaveTask& task) {
  using U = UInt<F>;
  const CameraSetup& camera = *context.camera;
  const Settings& settings = *context.settings;
  PathPool& pool = wave.pool;
  RayQueue& rays = wave.rays;
  const uint32_t n = task.path_count();
  const float inv_samples = 1.f / static_cast<float>(task.samples);
  float* tfar = wave.shadows.tfar;  // this column is unused until the first shading stage
  wave.aovs.clear(n);
  wave.history.clear(n);
  const PathEvents events = wave.events(context);
  for (uint32_t i = 0; i < n; i += kWidth<F>) {
    const Mask<F> active = first_lanes<F>(n - i);
    const U slot = lane_index<F>() + i;
    // Compute slot / samples by a reciprocal. The result is exact because slots are below 2^20, and
    // because the added 0.5 keeps quotients away from integers.
    const U index = U(to_int<F>((F(Int<F>(slot)) + 0.5f) * inv_samples));
    const U pixel = gather<U>(task.pixels, index, Mask<U>(active));
    const U sample = slot - index * task.samples + task.first_sample;
    const SampleKey<F> key = make_sample_key<F>(pixel, sample, settings.seed);
    const Sample4<F> r = inlined_sample_4d<F>(settings.sampler, key, kCameraSet);
    F time(0.f);
    if (context.moves()) {
      time = camera_time<F>(camera, F(Int<F>(pixel & 0xffffu)), F(Int<F>(pixel >> 16)),
                            path_time<F>(settings.sampler, key));
      scatter_field<F>(pool.cold, &PathColdRow<float>::time, slot, time, active);
    }
    if (context.uses_pixel_importance())
      scatter_field<F>(pool.cold, &PathColdRow<float>::importance, slot,
                       pixel_importance<F>(*context.guide, F(Int<F>(pixel & 0xffffu)),
                                           F(Int<F>(pixel >> 16)), active),
                       active);
    const CameraRay<F> ray =
        camera_ray<F>(camera, F(Int<F>(pixel & 0xffffu)), F(Int<F>(pixel >> 16)), r, active, time);
    store_row<PathRow, F>(pool.paths, slot,
                          {.o = ray.o,
                           .d = ray.d,
                           .throughput = Color<F>(F(1.f)),
                           .pdf = F(0.f),
                           .eta_scale = F(1.f),
                           .cone_width = ray.width,
                           .cone_spread = ray.spread,
                           .key = key,
                           .receiver = UInt<F>(0u)},
                          active);
    events.begin<F>(r, slot, active);
    store(rays.ox + i, ray.o.x);
    store(rays.oy + i, ray.o.y);
    store(rays.oz + i, ray.o.z);
    store(rays.dx + i, ray.d.x);
    store(rays.dy + i, ray.d.y);
    store(rays.dz + i, ray.d.z);
    store(rays.slot + i, slot);
    store(tfar + i, ray.tfar);
  }
  std::memset(pool.radiance, 0, n * kRadianceWords * sizeof(float));
  rays.size = n;
  return camera.has_far ? tfar : nullptr;
}

}  // namespace wavecomb
