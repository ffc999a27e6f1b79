// SPDX-License-Identifier: Apache-2.0
/// How the work of a render is shared out: times of groups of waves, and what they would take on
/// other numbers of threads.
#pragma once

#include <array>
#include <cstdint>
#include <span>

namespace wavecomb {

/// Numbers of threads that times are told for.
inline constexpr std::array<uint32_t, 7> kSharedBy = {1, 2, 4, 8, 16, 32, 64};

/// Adds up the passes of a render.
///
/// A pass ends when its last group does, so it takes at least its longest group, and at least the
/// mean over its threads. What it takes by list scheduling (each thread that is free takes the next
/// group of the plan: Graham 1969, at most 2 - 1 / threads times the least) is told from the times
/// that the groups took on the threads that there were; that more threads share caches, memory and
/// clock is not in it.
class Sharing {
 public:
  /// A pass whose groups took `group_s` seconds each, in the order of its plan.
  void add_pass(std::span<const float> group_s);

  uint64_t groups() const { return groups_; }
  double longest_s() const { return longest_s_; }
  /// Seconds of all passes on kSharedBy[i] threads.
  double passes_s(size_t i) const { return passes_s_[i]; }

 private:
  uint64_t groups_ = 0;
  double longest_s_ = 0;
  std::array<double, kSharedBy.size()> passes_s_{};
};

}  // namespace wavecomb
