// SPDX-License-Identifier: Apache-2.0
/// Per-pixel statistics for error estimation.
#pragma once

#include <cstddef>
#include <cstdint>

namespace wavecomb {

/// Sum of one half of a pixel's samples, and the running variance of all its samples.
///
/// The two halves are separate estimates of the same value. They alternate in blocks of kHalfBlock
/// samples, since such a block of the Sobol sequence is a (t,m,s)-net and the next block fills its
/// gaps, so that both halves stay well distributed. The variance is computed by Welford's method
/// (Technometrics 4(3), 1962, p. 419). This variance treats samples as independent, which Sobol
/// samples are not, so it is only an output and never controls sampling.
struct ErrorSums {
  /// Number of samples in a block, a power of two. A pixel needs at least two blocks for an error
  /// estimate.
  static constexpr uint32_t kHalfBlock = 8;

  double half[3] = {0, 0, 0};  ///< sum of the samples in even blocks
  double m2[3] = {0, 0, 0};    ///< sum of squared differences from the running mean

  /// Returns how many of a pixel's first n samples are summed in `half`.
  static constexpr uint32_t half_count(uint32_t n) {
    const uint32_t rest = n % (2 * kHalfBlock);
    return n / (2 * kHalfBlock) * kHalfBlock + (rest < kHalfBlock ? rest : kHalfBlock);
  }

  /// Adds the sample with number `index` of a pixel; `sum` is the sum of all earlier samples.
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
