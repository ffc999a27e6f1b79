// SPDX-License-Identifier: Apache-2.0
/// Wave stage 5: adds the radiance of all paths to the film. The samples of each pixel are added in
/// sample order.
#pragma once

#include <cmath>
#include <cstring>

#include "wavecomb/wave/wave.h"

namespace wavecomb {

namespace detail {

/// Adds the rows of slots [first, end) to `sum`, value by value and in slot order.
template <size_t N>
inline void add_rows(const float* rows, size_t first, size_t end, double (&sum)[N]) {
  for (size_t s = first; s < end; ++s)
    for (size_t c = 0; c < N; ++c) sum[c] += double{rows[s * N + c]};
}

/// Adds the radiance of slots [first, end) to the error sums of `pixel`. Call this function before
/// the film adds these samples to the pixel.
inline void add_errors(const float* rows, size_t first, size_t end, const Film::Pixel& pixel,
                       ErrorSums& errors) {
  double sum[3] = {pixel.r, pixel.g, pixel.b};
  uint32_t index = pixel.samples;
  for (size_t s = first; s < end; ++s, ++index) {
    const float* rgb = rows + s * kRadianceWords;
    errors.add(rgb, index, sum);
    for (size_t c = 0; c < 3; ++c) sum[c] += double{rgb[c]};
  }
}

}  // namespace detail

inline void resolve(const Wave& wave, const WaveContext& context, const WaveTask& task) {
  float* const radiance = wave.pool.radiance;
  Film& film = *context.film;
  const float exposure = context.camera->exposure;
  if (exposure != 1) {
    for (size_t i = 0; i < task.path_count() * kRadianceWords; ++i) radiance[i] *= exposure;
    wave.aovs.expose(exposure, task.path_count());
  }
  size_t slot = 0;
  for (uint32_t i = 0; i < task.pixel_count; ++i) {
    const uint32_t x = task.pixels[i] & 0xffffu, y = task.pixels[i] >> 16;
    const size_t end = slot + task.samples;
    Film::Pixel& pixel = film.pixel(x, y);
    if (film.has_error()) detail::add_errors(radiance, slot, end, pixel, film.error(x, y));
    for (size_t s = slot; film.has_cascades() && s < end; ++s)
      film.cascades().add(film.index(x, y), radiance + s * kRadianceWords);
    double sum[kRadianceWords] = {pixel.r, pixel.g, pixel.b};
    detail::add_rows(radiance, slot, end, sum);
    pixel = {sum[0], sum[1], sum[2], pixel.samples + task.samples};
    wave.aovs.resolve(film.aovs(), film.index(x, y), slot, end, radiance);
    slot = end;
  }
}

}  // namespace wavecomb
