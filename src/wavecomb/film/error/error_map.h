// SPDX-License-Identifier: Apache-2.0
/// Estimates of image noise from the half buffers of a film.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "wavecomb/film/film.h"

namespace wavecomb {

/// Radius in pixels of the square window over which errors are averaged. The two halves of a single
/// pixel may agree by chance, but rarely those of all 25 pixels of the window.
inline constexpr uint32_t kErrorWindow = 2;

/// Error estimates of an image.
struct ErrorMap {
  /// Error of each pixel: the mean over the window of
  ///   e = sum over rgb |I - A| / sqrt(sum over rgb I),
  /// with I the mean of all samples and A the mean of one half of them (Dammertz, Hanika and
  /// Keller, "A Hierarchical Automatic Stopping Condition for Monte Carlo Global Illumination",
  /// WSCG 2010, equation 1). With light splats, I and A include the splats, and A includes only the
  /// splats of one half. For independent samples |I - A| is distributed like |I - truth|. The error
  /// is infinite if no pixel of the window has an estimate yet; pixels that are not finite count as
  /// 0.
  std::vector<float> error;
  /// Mean relative error of the image, sum |I - A| / sum I over all pixels and channels; infinite
  /// if no pixel has an estimate yet.
  double mean_relative = 0;
  /// sum I / sum sqrt(sum over rgb I), which is the value that the pixel error e would have in
  /// every pixel if the mean relative error were 1 and the noise were evenly distributed.
  double even_error = 0;
};

/// Returns the error map of a film that has error sums.
ErrorMap measure_error(const Film& film);

/// Noise of an image by origin: sums over pixels of squared error / light, for the pixels' own
/// samples and for light splats.
struct NoiseParts {
  double own = 0, splats = 0;
};
/// Returns the noise of the pixels whose `active` flag is set, or of all pixels if `active` is
/// empty.
NoiseParts measure_noise_parts(const Film& film, std::span<const uint8_t> active);

}  // namespace wavecomb
