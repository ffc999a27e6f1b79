// SPDX-License-Identifier: Apache-2.0
/// The clock that all times are taken by.
#pragma once

#include <chrono>

namespace wavecomb {

using Clock = std::chrono::steady_clock;

/// Seconds from `start` to now.
inline double seconds_since(Clock::time_point start) {
  return std::chrono::duration<double>(Clock::now() - start).count();
}

}  // namespace wavecomb
