// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/render/statistics/work_distribution.h"

#include <gtest/gtest.h>

#include <array>
#include <numeric>
#include <vector>

namespace wavecomb {
namespace {

TEST(WorkDistribution, EachThreadTakesTheNextGroup) {
  WorkDistribution sharing;
  // With two threads, one takes groups of 3 s and 2 s and the other groups of 1 s and 2 s, so the
  // first pass takes 5 s. The second pass starts when the first has ended.
  sharing.add_pass(std::array{3.0f, 1.0f, 2.0f, 2.0f});
  sharing.add_pass(std::array{0.5f});
  EXPECT_EQ(sharing.groups(), 5u);
  EXPECT_EQ(sharing.longest_s(), 3.0);
  EXPECT_EQ(sharing.passes_s(0), 8.5);
  EXPECT_EQ(sharing.passes_s(1), 5.0 + 0.5);
  EXPECT_EQ(sharing.passes_s(2), 3.0 + 0.5);
}

TEST(WorkDistribution, LiesWithinGrahamsBounds) {
  std::vector<float> group_s;
  for (uint32_t i = 0; i < 1000; ++i) group_s.push_back(static_cast<float>((i * 7919) % 101 + 1));
  const double sum = std::accumulate(group_s.begin(), group_s.end(), 0.0);
  WorkDistribution sharing;
  sharing.add_pass(group_s);
  for (size_t i = 0; i < kThreadCounts.size(); ++i) {
    EXPECT_GE(sharing.passes_s(i), sum / kThreadCounts[i]);
    EXPECT_LE(sharing.passes_s(i), sum / kThreadCounts[i] + sharing.longest_s());
  }
}

TEST(WorkDistribution, NothingTakesNoTime) {
  WorkDistribution sharing;
  sharing.add_pass({});
  EXPECT_EQ(sharing.groups(), 0u);
  EXPECT_EQ(sharing.passes_s(1), 0.0);
}

}  // namespace
}  // namespace wavecomb
