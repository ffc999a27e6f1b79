// SPDX-License-Identifier: Apache-2.0
/// Estimates of image noise, from the difference between all samples of a film and one half of its
/// samples.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "wavecomb/film/film.h"

namespace wavecomb {

/// Radius in pixels of the square window over which errors are averaged. In a single pixel, the
/// means of the two halves may agree by chance. Such an agreement is rare in all 25 pixels of the
/// window.
inline constexpr uint32_t kErrorWindow = 2;

/// Error estimates of an image.
struct ErrorMap {
  /// Error of each pixel, which is the mean over the window of
  ///   e = sum over rgb |I - A| / sqrt(sum over rgb I),
  /// where I is the mean of all samples and A the mean of one half of the samples (Dammertz, Hanika
  /// and Keller, "A Hierarchical Automatic Stopping Condition for Monte Carlo Global Illumination",
  /// WSCG 2010, equation 1). I includes all light splats, and A the light splats of one half. If
  /// samples are independent, |I - A| has the same distribution as the error of I. The error is
  /// infinite if no pixel of the window has an estimate yet. Pixels with values that are not finite
  /// count as 0.
  std::vector<float> error;
  /// Mean relative error of the image, sum |I - A| / sum I over all pixels and channels; infinite
  /// if no pixel has an estimate yet.
  double mean_relative = 0;
  /// Error of each pixel of an image whose mean relative error is 1 and whose error is the same in
  /// all pixels: sum I / sum sqrt(sum over rgb I).
  double even_error = 0;
};

/// Computes the error estimates of a film, which must have error sums.
ErrorMap measure_error(const Film& film);

/// Noise of an image, split by source into camera paths (`own`) and light splats. Each value is the
/// sum over pixels of the squared error divided by the pixel's value.
struct NoiseParts {
  double own = 0, splats = 0;
};
/// Returns the noise of the pixels whose `active` flag is set, or of all pixels if `active` is
/// empty.
NoiseParts measure_noise_parts(const Film& film, std::span<const uint8_t> active);

}  // namespace wavecomb
