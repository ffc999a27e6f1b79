// SPDX-License-Identifier: Apache-2.0
/// Clock for all time measurements.
#pragma once

#include <chrono>

namespace wavecomb {

using Clock = std::chrono::steady_clock;

/// Returns the seconds from `start` to now.
inline double seconds_since(Clock::time_point start) {
  return std::chrono::duration<double>(Clock::now() - start).count();
}

}  // namespace wavecomb
