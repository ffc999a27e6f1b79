// SPDX-License-Identifier: Apache-2.0
/// What the sums of a picture share: how they become means, and how they are let go.
#pragma once

#include <cstdint>
#include <vector>

namespace wavecomb {

/// 1 / n, or 0 where n is 0: the factor that makes a mean of a sum of n samples.
inline double inverse_count(uint32_t n) {
  return n == 0 ? 0.0 : 1.0 / n;
}

/// Frees what a vector holds.
template <typename T>
void release(std::vector<T>& values) {
  std::vector<T>().swap(values);
}

}  // namespace wavecomb
