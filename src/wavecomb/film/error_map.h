// SPDX-License-Identifier: Apache-2.0
/// How noisy a picture is, by the half buffers of its film.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "wavecomb/film/film.h"

namespace wavecomb {

/// Pixels to each side of the square that an error is the mean of: a single pixel's two halves may
/// agree by chance, 25 pixels' do not.
inline constexpr uint32_t kErrorWindow = 2;

/// Errors of a picture.
struct ErrorMap {
  /// By pixel, mean over the window of
  ///   e = sum over rgb |I - A| / sqrt(sum over rgb I)
  /// with I the mean of all samples and A that of one half (Dammertz, Hanika and Keller, "A
  /// Hierarchical Automatic Stopping Condition for Monte Carlo Global Illumination", WSCG 2010,
  /// equation 1). Where light comes of splats, too, I and A are sums of both, each with halves of
  /// its own. For independent samples |I - A| has the distribution of |I - truth|. Infinite
  /// where no pixel of the window has an error yet; pixels that are not finite count as 0.
  std::vector<float> error;
  /// Sum |I - A| / sum I over picture and channels; infinite where no pixel has an error yet.
  double mean_relative = 0;
  /// sum I / sum sqrt(sum over rgb I): the e that all pixels have in a picture of mean relative
  /// error 1 whose noise is spread evenly.
  double even_error = 0;
};

/// Measures the film, which has error sums.
ErrorMap measure_error(const Film& film);

/// What of the squared errors, over the light, comes of pixels' own samples and what of splats.
struct NoiseParts {
  double own = 0, splats = 0;
};
/// Of the pixels in `active`; of all, where it is empty.
NoiseParts measure_noise_parts(const Film& film, std::span<const uint8_t> active);

}  // namespace wavecomb
