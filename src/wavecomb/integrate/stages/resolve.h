// SPDX-License-Identifier: Apache-2.0
/// Stage 5: radiance of the slots into the film, a pixel's samples in sample order.
#pragma once

#include <cmath>

#include "wavecomb/integrate/wave.h"

namespace wavecomb {

namespace detail {

/// Adds the rows of slots [first, end) to `sum`, word by word, in the order of the slots.
template <size_t N>
inline void add_rows(const float* rows, size_t first, size_t end, double (&sum)[N]) {
  for (size_t s = first; s < end; ++s)
    for (size_t c = 0; c < N; ++c) sum[c] += double{rows[s * N + c]};
}

/// The same rows into the error sums of `pixel`, which does not have them yet.
inline void add_errors(const float* rows, size_t first, size_t end, const Film::Pixel& pixel,
                       ErrorSums& errors) {
  double sum[3] = {pixel.r, pixel.g, pixel.b};
  uint32_t index = pixel.samples;
  for (size_t s = first; s < end; ++s, ++index) {
    const float* rgb = rows + s * PathPool::kRadianceWords;
    errors.add(rgb, index, sum);
    for (size_t c = 0; c < 3; ++c) sum[c] += double{rgb[c]};
  }
}

}  // namespace detail

inline void resolve(const Wave& wave, const WaveContext& context, const WaveTask& task) {
  const PathPool& pool = wave.pool;
  Film& film = *context.film;
  size_t slot = 0;
  for (uint32_t i = 0; i < task.pixel_count; ++i) {
    const uint32_t x = task.pixels[i] & 0xffffu, y = task.pixels[i] >> 16;
    const size_t end = slot + task.samples;
    Film::Pixel& pixel = film.pixel(x, y);
    if (film.has_error()) detail::add_errors(pool.radiance, slot, end, pixel, film.error(x, y));
    double sum[PathPool::kRadianceWords] = {pixel.r, pixel.g, pixel.b};
    detail::add_rows(pool.radiance, slot, end, sum);
    pixel = {sum[0], sum[1], sum[2], pixel.samples + task.samples};
    if (pool.has_aovs) {
      Film::AovPixel& aov = film.aov(x, y);
      double hit[PathPool::kFirstWords] = {aov.albedo[0], aov.albedo[1], aov.albedo[2],
                                           aov.normal[0], aov.normal[1], aov.normal[2]};
      detail::add_rows(pool.first, slot, end, hit);
      for (size_t c = 0; c < 3; ++c) {
        aov.albedo[c] = hit[c];
        aov.normal[c] = hit[3 + c];
      }
      for (size_t s = slot; s < end; ++s)
        if (std::isfinite(pool.depth[s])) {
          aov.depth += double{pool.depth[s]};
          ++aov.depth_samples;
        }
    }
    slot = end;
  }
}

}  // namespace wavecomb
