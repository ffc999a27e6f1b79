// SPDX-License-Identifier: Apache-2.0
/// Statistics of a pixel's samples, from which errors are estimated.
#pragma once

#include <cstddef>
#include <cstdint>

namespace wavecomb {

/// Sum of one half of a pixel's samples, and the running variance of all its samples.
///
/// The two halves are independent estimates of the pixel's value. Blocks of `kHalfBlock` samples
/// belong to the halves alternately. A block of the Sobol sequence is a (t,m,s)-net, and the next
/// block fills the gaps of this net, so that both halves are well distributed. The variance is
/// computed by Welford's method (Technometrics 4(3), 1962, p. 419). Welford's method assumes
/// independent samples. Since Sobol samples are not independent, the variance is only written to
/// images and never controls sampling.
struct ErrorSums {
  /// Number of samples in a block, a power of two. A pixel needs at least two blocks for an error
  /// estimate.
  static constexpr uint32_t kHalfBlock = 8;

  double half[3] = {0, 0, 0};  ///< sum of the samples in blocks with even numbers
  double m2[3] = {0, 0, 0};    ///< Welford's sum of squared differences from the mean

  /// Returns how many of a pixel's first `n` samples belong to `half`.
  static constexpr uint32_t half_count(uint32_t n) {
    const uint32_t rest = n % (2 * kHalfBlock);
    return n / (2 * kHalfBlock) * kHalfBlock + (rest < kHalfBlock ? rest : kHalfBlock);
  }

  /// Adds sample number `index` of a pixel. `sum` is the sum of all earlier samples of the pixel.
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
