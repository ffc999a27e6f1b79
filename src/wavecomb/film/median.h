// SPDX-License-Identifier: Apache-2.0
/// Streaming estimate of a median in constant memory.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>

namespace wavecomb {

/// Estimate of the median of a stream of values with the five markers of the P^2 algorithm (Jain
/// and Chlamtac, "The P2 Algorithm for Dynamic Calculation of Quantiles and Histograms Without
/// Storing Observations", 1985). The values d must be positive or infinite. The markers estimate
/// quantiles of d / (d + s), which is at most 1, where s is the first finite value. The caller
/// provides the memory of the state, which is an array of `kWords` doubles with initial values 0.
///
/// Contract: the result depends only on the values and their order.
class MedianSketch {
 public:
  static constexpr uint32_t kWords = 11;

  explicit MedianSketch(double* state) : s_(state) {}

  void add(double d) {
    double u = 1;
    if (std::isfinite(d)) {
      if (s_[kScale] == 0) s_[kScale] = std::max(d, 1e-30);
      u = d / (d + s_[kScale]);
    } else {
      ++s_[kInfinite];
    }
    const auto count = static_cast<uint32_t>(++s_[kCount]);
    double* const q = s_ + kHeights;
    if (count <= kMarkers) {
      q[count - 1] = u;
      std::sort(q, q + count);
      for (uint32_t i = 1; i + 1 < kMarkers; ++i) s_[kPositions + i - 1] = i;
      return;
    }
    q[0] = std::min(q[0], u);
    q[kMarkers - 1] = std::max(q[kMarkers - 1], u);
    for (uint32_t i = 1; i + 1 < kMarkers; ++i)
      if (u < q[i]) ++s_[kPositions + i - 1];
    for (uint32_t i = 1; i + 1 < kMarkers; ++i) adjust(i);
  }

 private:
  friend double median_of(const double* state);
  enum Word : uint32_t { kScale, kCount, kInfinite, kHeights, kPositions = kHeights + 5 };
  static constexpr uint32_t kMarkers = 5;

  /// Returns how many values are below marker `i`.
  double marker_position(uint32_t i) const {
    if (i == 0) return 0;
    return i + 1 == kMarkers ? s_[kCount] - 1 : s_[kPositions + i - 1];
  }
  /// Moves marker `i` by one position if its distance from the ideal position is at least one.
  void adjust(uint32_t i) {
    double* const q = s_ + kHeights;
    const double at = marker_position(i), before = marker_position(i - 1),
                 after = marker_position(i + 1);
    const double wants = (s_[kCount] - 1) * i / (kMarkers - 1) - at;
    double step = 0;
    if (wants >= 1 && after - at > 1) step = 1;
    if (wants <= -1 && before - at < -1) step = -1;
    if (step == 0) return;
    const double up = (q[i + 1] - q[i]) / (after - at), down = (q[i] - q[i - 1]) / (at - before);
    const double curved =
        q[i] + step / (after - before) * ((at - before + step) * up + (after - at - step) * down);
    if (q[i - 1] < curved && curved < q[i + 1])
      q[i] = curved;
    else
      q[i] += step > 0 ? up : -down;
    s_[kPositions + i - 1] += step;
  }

  double* s_;
};

/// Returns the median that the state of a `MedianSketch` estimates. The estimate is infinite if
/// more than half of the values were infinite, or if there are no values.
inline double median_of(const double* state) {
  using S = MedianSketch;
  const double infinity = std::numeric_limits<double>::infinity();
  const auto count = static_cast<uint32_t>(state[S::kCount]);
  if (count == 0 || 2 * state[S::kInfinite] > state[S::kCount]) return infinity;
  const double u = state[S::kHeights + (count < S::kMarkers ? (count - 1) / 2 : S::kMarkers / 2)];
  return u < 1 ? state[S::kScale] * u / (1 - u) : infinity;
}

}  // namespace wavecomb
