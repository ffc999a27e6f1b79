// SPDX-License-Identifier: Apache-2.0
/// Work distribution of a render: durations of wave groups, and the predicted render time with
/// other numbers of threads.
#pragma once

#include <array>
#include <cstdint>
#include <span>

namespace wavecomb {

/// Numbers of threads for which times are predicted.
inline constexpr std::array<uint32_t, 7> kThreadCounts = {1, 2, 4, 8, 16, 32, 64};

/// Work distribution, added up over the passes of a render.
///
/// A pass ends when its last group ends, so it takes at least as long as the longest group, and at
/// least as long as the mean work of a thread. The duration of a pass is predicted by list
/// scheduling, in which each free thread takes the next group of the plan (Graham 1969: at most 2 -
/// 1 / threads times the optimum). The prediction uses the measured durations of the groups, so it
/// ignores that more threads have to share caches, memory bandwidth and clock speed.
class WorkDistribution {
 public:
  /// Adds a pass whose groups took `group_s` seconds each, in the order of its plan.
  void add_pass(std::span<const float> group_s);

  uint64_t groups() const { return groups_; }
  double longest_s() const { return longest_s_; }
  /// Returns the predicted seconds of all passes on kThreadCounts[i] threads.
  double passes_s(size_t i) const { return passes_s_[i]; }

 private:
  uint64_t groups_ = 0;
  double longest_s_ = 0;
  std::array<double, kThreadCounts.size()> passes_s_{};
};

}  // namespace wavecomb
