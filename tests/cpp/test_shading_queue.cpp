// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/schedule/shading_queue.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <numeric>
#include <random>

namespace wavecomb {
namespace {

using Column = ShadingQueue::Column;
constexpr uint32_t kColumns = ShadingQueue::kColumns;

/// Fills the queue with n random records and gives it a random order.
std::vector<std::vector<uint32_t>> fill(ShadingQueue& queue, size_t n, uint32_t seed) {
  std::mt19937 rng(seed);
  queue.clear();
  queue.size = n;
  std::vector<std::vector<uint32_t>> records(kColumns, std::vector<uint32_t>(n));
  for (uint32_t c = 0; c < kColumns; ++c)
    for (size_t i = 0; i < n; ++i)
      queue.uints(static_cast<Column>(c))[i] = records[c][i] = static_cast<uint32_t>(rng());
  std::iota(queue.sorted_indices, queue.sorted_indices + n, 0u);
  std::shuffle(queue.sorted_indices, queue.sorted_indices + n, rng);
  queue.ordered = true;
  return records;
}

TEST(ShadingQueue, MaterializeEqualsGatherTwiceInARow) {
  ShadingQueue queue(300);
  for (uint32_t round = 0; round < 5; ++round) {
    for (const size_t n : {300u, 1u, 0u, 17u, 299u}) {
      const auto records = fill(queue, n, 10 * round + static_cast<uint32_t>(n));
      const std::vector<uint32_t> order(queue.sorted_indices, queue.sorted_indices + n);
      queue.materialize();
      EXPECT_FALSE(queue.ordered);
      EXPECT_EQ(queue.size, n);
      for (uint32_t c = 0; c < kColumns; ++c)
        for (size_t i = 0; i < n; ++i)
          ASSERT_EQ(queue.uints(static_cast<Column>(c))[i], records[c][order[i]]) << c << ", " << i;
      // In order already: nothing moves.
      const uint32_t* before = queue.uints(Column::kSlot);
      queue.materialize();
      EXPECT_EQ(queue.uints(Column::kSlot), before);
      // And once more, the other way about.
      for (size_t i = 0; i < n; ++i) queue.sorted_indices[i] = static_cast<uint32_t>(n - 1 - i);
      queue.ordered = true;
      queue.materialize();
      for (uint32_t c = 0; c < kColumns; ++c)
        for (size_t i = 0; i < n; ++i)
          ASSERT_EQ(queue.uints(static_cast<Column>(c))[i], records[c][order[n - 1 - i]]);
    }
  }
}

TEST(ShadingQueue, ColumnsAreAlignedAndApart) {
  const ShadingQueue queue(100);
  for (uint32_t c = 0; c < kColumns; ++c) {
    const auto a = reinterpret_cast<uintptr_t>(queue.uints(static_cast<Column>(c)));
    EXPECT_EQ(a % 64, 0u);
    for (uint32_t d = 0; d < c; ++d) {
      const auto b = reinterpret_cast<uintptr_t>(queue.uints(static_cast<Column>(d)));
      EXPECT_GE(a > b ? a - b : b - a, 4u * (100 + SoaBlock::kPad));
    }
  }
  EXPECT_EQ(reinterpret_cast<void*>(queue.floats(Column::kT)), queue.uints(Column::kT));
  EXPECT_GE(queue.bytes(), 2u * kColumns * 4 * 100);
}

TEST(ShadingQueue, ClearForgetsTheOrder) {
  ShadingQueue queue(10);
  fill(queue, 10, 1);
  queue.clear();
  EXPECT_EQ(queue.size, 0u);
  EXPECT_FALSE(queue.ordered);
}

}  // namespace
}  // namespace wavecomb
