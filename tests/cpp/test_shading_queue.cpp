// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/schedule/shading_queue.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <numeric>
#include <random>

namespace wavecomb {
namespace {

using Q = ShadingQueue;
constexpr size_t kWords = 8;  // per row

/// A record as it arrived: its columns, the words of its row, and values stored by arrival index.
struct Record {
  std::array<uint32_t, Q::kColumns> column;
  std::array<uint32_t, kWords> row;
  uint32_t slot, outcome;
};

/// Fills the queue with n random records (arbitrary bits, including NaN) in random order.
std::vector<Record> fill(ShadingQueue& queue, size_t n, uint32_t seed) {
  std::mt19937 rng(seed);
  const auto random = [&] { return static_cast<uint32_t>(rng()); };
  queue.clear();
  queue.size = n;
  std::vector<Record> records(n);
  for (size_t i = 0; i < n; ++i) {
    Record& r = records[i];
    for (uint32_t c = 0; c < Q::kColumns; ++c)
      queue.uints(static_cast<Q::Column>(c))[i] = r.column[c] = random();
    for (uint32_t& word : r.row) word = random();
    std::memcpy(queue.row(i), r.row.data(), sizeof(r.row));
    queue.slot[i] = r.slot = random();
    queue.outcome[i] = r.outcome = random();
  }
  std::iota(queue.sorted_indices, queue.sorted_indices + n, 0u);
  std::shuffle(queue.sorted_indices, queue.sorted_indices + n, rng);
  queue.ordered = true;
  return records;
}

/// Expects the records to be in the given order of arrival.
void expect_records(const ShadingQueue& queue, const std::vector<Record>& records,
                    const std::vector<uint32_t>& order) {
  ASSERT_EQ(queue.size, order.size());
  for (size_t i = 0; i < order.size(); ++i) {
    const Record& r = records[order[i]];
    for (uint32_t c = 0; c < Q::kColumns; ++c)
      ASSERT_EQ(queue.uints(static_cast<Q::Column>(c))[i], r.column[c]) << c << ", " << i;
    ASSERT_EQ(std::memcmp(queue.row(i), r.row.data(), sizeof(r.row)), 0) << i;
    ASSERT_EQ(queue.slot[i], records[i].slot);
    ASSERT_EQ(queue.outcome[i], records[i].outcome);
  }
}

TEST(ShadingQueue, MaterializeMovesColumnsAndRows) {
  ShadingQueue queue(300, kWords);
  for (uint32_t round = 0; round < 5; ++round) {
    for (const size_t n : {300u, 1u, 0u, 17u, 299u}) {
      const auto records = fill(queue, n, 10 * round + static_cast<uint32_t>(n));
      EXPECT_FALSE(queue.moved);
      const std::vector<uint32_t> order(queue.sorted_indices, queue.sorted_indices + n);
      queue.materialize();
      EXPECT_FALSE(queue.ordered);
      EXPECT_TRUE(queue.moved);
      expect_records(queue, records, order);
      EXPECT_EQ(std::vector<uint32_t>(queue.sorted_indices, queue.sorted_indices + n), order);
      const float* before = queue.row(0);
      queue.materialize();
      EXPECT_EQ(queue.row(0), before);
      expect_records(queue, records, order);
    }
  }
}

TEST(ShadingQueue, WithoutAnOrderNothingMoves) {
  ShadingQueue queue(40, kWords);
  const auto records = fill(queue, 40, 3);
  queue.ordered = false;
  queue.materialize();
  EXPECT_FALSE(queue.moved);
  std::vector<uint32_t> arrival(40);
  std::iota(arrival.begin(), arrival.end(), 0u);
  expect_records(queue, records, arrival);
}

TEST(ShadingQueue, ColumnsAreAlignedAndApart) {
  const ShadingQueue queue(100, kWords);
  struct Range {
    const void* begin;
    size_t words;
  };
  std::vector<Range> ranges = {{queue.row(0), 100 * kWords},
                               {queue.sorted_indices, 100},
                               {queue.slot, 100},
                               {queue.outcome, 100}};
  for (uint32_t c = 0; c < Q::kColumns; ++c)
    ranges.push_back({queue.uints(static_cast<Q::Column>(c)), 100});
  for (const Range& a : ranges) {
    const auto begin = reinterpret_cast<uintptr_t>(a.begin);
    EXPECT_EQ(begin % 64, 0u);
    for (const Range& b : ranges) {
      if (a.begin == b.begin) continue;
      // A packet may be written at any index below the capacity.
      const auto other = reinterpret_cast<uintptr_t>(b.begin);
      EXPECT_TRUE(other < begin || other >= begin + 4 * (a.words + SoaBlock::kPad));
    }
  }
  // The queue allocates memory for two copies of the records, because materialize() moves them from
  // one block to another.
  EXPECT_GE(queue.bytes(), 4u * 100 * (2u * Q::kColumns + 2u * kWords + 3u));
}

TEST(ShadingQueue, ClearForgetsTheOrder) {
  ShadingQueue queue(10, kWords);
  fill(queue, 10, 1);
  queue.clear();
  EXPECT_EQ(queue.size, 0u);
  EXPECT_FALSE(queue.ordered);
  fill(queue, 10, 2);
  queue.materialize();
  queue.clear();
  EXPECT_EQ(queue.size, 0u);
  EXPECT_FALSE(queue.moved);
}

}  // namespace
}  // namespace wavecomb
