// SPDX-License-Identifier: Apache-2.0
/// What a pixel keeps so that its error can be told from its own samples.
#pragma once

#include <cstddef>
#include <cstdint>

namespace wavecomb {

/// Two halves of a pixel's samples, and their running variance.
///
/// The halves are two estimates of one thing, each as well spread as a half can be: blocks of
/// kHalfBlock samples in turn, since a block of Sobol's sequence is a net and its neighbour fills
/// the gaps. The variance is Welford's (Technometrics 4(3), 1962, p. 419); it takes samples to be
/// independent, which those of Sobol's sequence are not, so it is shown and decides nothing.
struct ErrorSums {
  /// A power of two; twice this many samples are the fewest that have an error.
  static constexpr uint32_t kHalfBlock = 8;

  double half[3] = {0, 0, 0};  ///< sums of the samples of even blocks
  double m2[3] = {0, 0, 0};    ///< sums of squared differences from the running mean

  /// Of a pixel's first n samples, how many are in `half`.
  static constexpr uint32_t half_count(uint32_t n) {
    const uint32_t rest = n % (2 * kHalfBlock);
    return n / (2 * kHalfBlock) * kHalfBlock + (rest < kHalfBlock ? rest : kHalfBlock);
  }

  /// Adds sample number `index`; `sum` is that of the samples before it.
  void add(const float* rgb, uint32_t index, const double (&sum)[3]) {
    const double before = index == 0 ? 0.0 : 1.0 / index, after = 1.0 / (index + 1.0);
    const bool in_half = index / kHalfBlock % 2 == 0;
    for (size_t c = 0; c < 3; ++c) {
      const double x = rgb[c];
      m2[c] += (x - sum[c] * before) * (x - (sum[c] + x) * after);
      if (in_half) half[c] += x;
    }
  }
};

}  // namespace wavecomb
