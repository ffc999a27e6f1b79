// SPDX-License-Identifier: Apache-2.0
/// Helper functions for the sums of pixels.
#pragma once

#include <cstdint>
#include <vector>

namespace wavecomb {

/// Returns 1 / n, the factor between the sum and the mean of n samples. Returns 0 if n is 0.
inline double inverse_count(uint32_t n) {
  return n == 0 ? 0.0 : 1.0 / n;
}

/// Frees the memory of a vector.
template <typename T>
void release(std::vector<T>& values) {
  std::vector<T>().swap(values);
}

}  // namespace wavecomb
