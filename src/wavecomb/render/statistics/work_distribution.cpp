// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/render/statistics/work_distribution.h"

#include <algorithm>
#include <functional>
#include <queue>
#include <vector>

namespace wavecomb {
namespace {

double list_schedule(std::span<const float> group_s, uint32_t threads) {
  std::priority_queue<double, std::vector<double>, std::greater<>> free_at;
  for (uint32_t i = 0; i < threads; ++i) free_at.push(0);
  double end = 0;
  for (const float s : group_s) {
    const double done = free_at.top() + static_cast<double>(s);
    free_at.pop();
    free_at.push(done);
    end = std::max(end, done);
  }
  return end;
}

}  // namespace

void Sharing::add_pass(std::span<const float> group_s) {
  groups_ += group_s.size();
  for (const float s : group_s) longest_s_ = std::max(longest_s_, static_cast<double>(s));
  for (size_t i = 0; i < kSharedBy.size(); ++i)
    passes_s_[i] += list_schedule(group_s, kSharedBy[i]);
}

}  // namespace wavecomb
