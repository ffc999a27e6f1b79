// SPDX-License-Identifier: Apache-2.0
/// Stage 5: radiance of the slots into the film, a pixel's samples in sample order.
#pragma once

#include <cmath>
#include <cstring>

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

/// The camera's exposure: multiplies the radiance of all slots, with its parts and light groups.
inline void expose(const PathPool& pool, float exposure, size_t slots) {
  const auto scale = [exposure](float* values, size_t count) {
    for (size_t i = 0; values && i < count; ++i) values[i] *= exposure;
  };
  const size_t words = slots * PathPool::kRadianceWords;
  scale(pool.radiance, words);
  scale(pool.parts[0], words);
  scale(pool.parts[1], words);
  scale(pool.groups, words * pool.light_groups);
}

/// What slots [slot, end) found beside radiance, into the AOVs of their pixel.
inline void resolve_aovs(const PathPool& pool, const AovTables* tables, AovFilm& film, size_t pixel,
                         size_t slot, size_t end) {
  using P = PathPool;
  if (film.has_first()) {
    AovFilm::First& first = film.first(pixel);
    if (pool.first) {
      double hit[P::kFirstWords] = {first.albedo[0], first.albedo[1], first.albedo[2],
                                    first.normal[0], first.normal[1], first.normal[2]};
      detail::add_rows(pool.first, slot, end, hit);
      for (size_t c = 0; c < 3; ++c) {
        first.albedo[c] = hit[c];
        first.normal[c] = hit[3 + c];
      }
    }
    for (size_t s = slot; pool.depth && s < end; ++s)
      if (std::isfinite(pool.depth[s])) {
        first.depth += double{pool.depth[s]};
        ++first.depth_samples;
      }
  }
  const float no_uv[2] = {0, 0};
  for (size_t s = slot; pool.hits && s < end; ++s) {
    AovHit hit;
    std::memcpy(static_cast<void*>(&hit), pool.hits + s * P::kHitWords, sizeof(hit));
    film.add_hit(pixel, hit, pool.centre ? pool.centre[s] : 0,
                 pool.wants_uv ? pool.first + s * P::kFirstWords + 6 : no_uv,
                 tables ? &tables->crypto : nullptr);
  }
  for (size_t s = slot; pool.parts[0] && s < end; ++s) {
    const size_t row = s * P::kRadianceWords;
    film.add_parts(pixel, pool.parts[0] + row, pool.parts[1] + row, pool.radiance + row);
  }
  if (pool.groups) {
    double* sums = film.groups(pixel);
    for (size_t s = slot; s < end; ++s)
      for (size_t g = 0; g < pool.light_groups; ++g)
        for (size_t c = 0; c < 3; ++c)
          sums[3 * g + c] +=
              double{pool.groups[(s * pool.light_groups + g) * P::kRadianceWords + c]};
  }
  for (size_t s = slot; pool.guides && s < end; ++s)
    film.add_guides(pixel, pool.guides + s * P::kGuideWords);
  for (size_t s = slot; pool.cost_ns && s < end; ++s) film.add_cost(pixel, double{pool.cost_ns[s]});
}

inline void resolve(const Wave& wave, const WaveContext& context, const WaveTask& task) {
  const PathPool& pool = wave.pool;
  Film& film = *context.film;
  if (context.camera->exposure != 1) expose(pool, context.camera->exposure, task.path_count());
  size_t slot = 0;
  for (uint32_t i = 0; i < task.pixel_count; ++i) {
    const uint32_t x = task.pixels[i] & 0xffffu, y = task.pixels[i] >> 16;
    const size_t end = slot + task.samples;
    Film::Pixel& pixel = film.pixel(x, y);
    if (film.has_error()) detail::add_errors(pool.radiance, slot, end, pixel, film.error(x, y));
    double sum[PathPool::kRadianceWords] = {pixel.r, pixel.g, pixel.b};
    detail::add_rows(pool.radiance, slot, end, sum);
    pixel = {sum[0], sum[1], sum[2], pixel.samples + task.samples};
    resolve_aovs(pool, context.aovs, film.aovs(), film.index(x, y), slot, end);
    slot = end;
  }
}

}  // namespace wavecomb
