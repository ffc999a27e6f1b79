// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/film/error/error_map.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

namespace wavecomb {
namespace {

/// Error terms of one pixel, summed over red, green and blue. `light` is the mean of all samples.
/// `difference` is the absolute difference between this mean and the mean of one half of the
/// samples, times the factor `scale` (see below). `camera_paths2` and `light_splats2` are the
/// squares of this product for camera paths only and for light splats only. `known` is false until
/// both halves have at least one full block of samples.
struct PixelError {
  double light = 0, difference = 0, camera_paths2 = 0, light_splats2 = 0;
  bool known = false;
};

PixelError pixel_error(const Film& film, size_t pixel) {
  const Film::Pixel& p = film.pixel(pixel);
  const ErrorSums& e = film.error(pixel);
  const uint32_t n = p.samples, in_half = ErrorSums::half_count(n);
  // The error is unknown until both halves have a full block of samples.
  if (n < 2 * ErrorSums::kHalfBlock) return {};
  const double sums[3] = {p.r, p.g, p.b};
  // Let I be the mean of n samples of variance var, and A the mean of the m samples in one half.
  // Then Var(I - A) = var (1 / m - 1 / n). The product of this variance and the square of `scale`
  // is var / n, the variance of I.
  const double scale = std::sqrt(static_cast<double>(in_half) / (n - in_half));
  PixelError out;
  std::array<double, 3> splats{}, light_splat_difference{};
  if (!film.splats().empty()) {
    splats = film.splats().mean(pixel);
    light_splat_difference = film.splats().difference(pixel);
  }
  for (size_t c = 0; c < 3; ++c) {
    const double mean = sums[c] / n, own = (mean - e.half[c] / in_half) * scale;
    out.light += mean + splats[c];
    out.difference += std::abs(own + light_splat_difference[c]);
    out.camera_paths2 += own * own;
    out.light_splats2 += light_splat_difference[c] * light_splat_difference[c];
  }
  if (!std::isfinite(out.light) || !std::isfinite(out.difference)) out = {};
  out.known = true;
  return out;
}

/// Replaces each value by the sum of the 2 * kErrorWindow + 1 values around it on the same row or
/// column of the image. This line has `length` values, which are `step` elements apart in `values`.
void sum_along(std::vector<float>& values, size_t lines, size_t line_step, size_t length,
               size_t step) {
  std::vector<float> line(length);
  for (size_t l = 0; l < lines; ++l) {
    float* at = values.data() + l * line_step;
    for (size_t i = 0; i < length; ++i) line[i] = at[i * step];
    for (size_t i = 0; i < length; ++i) {
      const size_t begin = i < kErrorWindow ? 0 : i - kErrorWindow;
      const size_t end = std::min(length, i + kErrorWindow + 1);
      float sum = 0;
      for (size_t k = begin; k < end; ++k) sum += line[k];
      at[i * step] = sum;
    }
  }
}

}  // namespace

ErrorMap measure_error(const Film& film) {
  const size_t width = film.width(), height = film.height();
  ErrorMap map;
  map.error.resize(width * height);
  std::vector<float> known(width * height);
  double light = 0, root = 0, difference = 0;
  size_t count = 0;
  for (size_t i = 0; i < map.error.size(); ++i) {
    const PixelError e = pixel_error(film, i);
    if (!e.known) continue;
    known[i] = 1;
    ++count;
    if (!(e.light > 0)) continue;
    map.error[i] = static_cast<float>(e.difference / std::sqrt(e.light));
    light += e.light;
    root += std::sqrt(e.light);
    difference += e.difference;
  }
  for (std::vector<float>* values : {&map.error, &known}) {
    sum_along(*values, height, width, width, 1);
    sum_along(*values, width, 1, height, width);
  }
  for (size_t i = 0; i < map.error.size(); ++i)
    map.error[i] = known[i] > 0 ? map.error[i] / known[i] : std::numeric_limits<float>::infinity();
  if (count == 0) map.mean_relative = std::numeric_limits<double>::infinity();
  if (light > 0) {
    map.mean_relative = difference / light;
    map.even_error = light / root;
  }
  return map;
}

NoiseParts measure_noise_parts(const Film& film, std::span<const uint8_t> active) {
  NoiseParts parts;
  for (size_t i = 0; i < film.pixel_count(); ++i) {
    if (!active.empty() && active[i] == 0) continue;
    const PixelError e = pixel_error(film, i);
    if (!e.known || !(e.light > 0)) continue;
    parts.own += e.camera_paths2 / e.light;
    parts.splats += e.light_splats2 / e.light;
  }
  return parts;
}

}  // namespace wavecomb
