// SPDX-License-Identifier: Apache-2.0
/// Time spent on paths, for the cost AOV.
#pragma once

#include "wavecomb/integrate/path_pool.h"
#include "wavecomb/integrate/phase_clock.h"

namespace wavecomb {

/// Spreads the time since `start` evenly over the paths in slots slot(0) ... slot(n - 1): time is
/// taken a batch at a time, so a path's share is the mean of its batch.
template <typename Slot>
inline void spread_cost(const PathPool& pool, size_t n, PhaseClock::Clock::time_point start,
                        const Slot& slot) {
  if (n == 0) return;
  const double ns =
      std::chrono::duration<double, std::nano>(PhaseClock::Clock::now() - start).count();
  const auto share = static_cast<float>(ns / static_cast<double>(n));
  for (size_t i = 0; i < n; ++i) pool.cost_ns[slot(i)] += share;
}

}  // namespace wavecomb
