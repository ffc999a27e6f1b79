// SPDX-License-Identifier: Apache-2.0
/// Stage 5: radiance of the slots into the film, a pixel's samples in sample order.
#pragma once

#include <cmath>

#include "wavecomb/integrate/wave.h"

namespace wavecomb {

inline void resolve(const Wave& wave, const WaveContext& context, const WaveTask& task) {
  const PathPool& pool = wave.pool;
  Film& film = *context.film;
  size_t slot = 0;
  for (uint32_t i = 0; i < task.pixel_count; ++i) {
    const uint32_t x = task.pixels[i] & 0xffffu, y = task.pixels[i] >> 16;
    Film::Pixel sum = film.pixel(x, y);
    const size_t end = slot + task.samples;
    for (size_t s = slot; s < end; ++s) {
      const float* c = pool.radiance + s * PathPool::kRadianceWords;
      sum.r += c[0];
      sum.g += c[1];
      sum.b += c[2];
    }
    sum.samples += task.samples;
    film.pixel(x, y) = sum;
    if (pool.has_aovs) {
      Film::AovPixel aov = film.aov(x, y);
      for (size_t s = slot; s < end; ++s) {
        aov.albedo[0] += pool.albedo_r[s];
        aov.albedo[1] += pool.albedo_g[s];
        aov.albedo[2] += pool.albedo_b[s];
        aov.normal[0] += pool.normal_x[s];
        aov.normal[1] += pool.normal_y[s];
        aov.normal[2] += pool.normal_z[s];
        if (std::isfinite(pool.depth[s])) {
          aov.depth += pool.depth[s];
          ++aov.depth_samples;
        }
      }
      film.aov(x, y) = aov;
    }
    slot = end;
  }
}

}  // namespace wavecomb
