// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/core/rows/soa.h"

#include <gtest/gtest.h>

#include <utility>
#include <vector>

#include "wavecomb/schedule/ray_queue.h"

namespace wavecomb {
namespace {

TEST(Soa, ColumnsAreAlignedZeroAndRoomy) {
  for (const size_t capacity : {1u, 15u, 16u, 17u, 1000u, 4096u}) {
    const SoaBlock block(3, capacity);
    for (size_t c = 0; c < 3; ++c) {
      EXPECT_EQ(reinterpret_cast<uintptr_t>(block.floats(c)) % 64, 0u);
      EXPECT_EQ(reinterpret_cast<void*>(block.floats(c)), block.uints(c));
      // Writes a packet at any index below the capacity.
      for (size_t i = 0; i < capacity + SoaBlock::kPad - 1; ++i) {
        EXPECT_EQ(block.uints(c)[i], 0u);
        block.uints(c)[i] = static_cast<uint32_t>(100000 * (c + 1) + i);
      }
    }
    for (size_t c = 0; c < 3; ++c)
      for (size_t i = 0; i < capacity + SoaBlock::kPad - 1; ++i)
        ASSERT_EQ(block.uints(c)[i], 100000 * (c + 1) + i);
    EXPECT_GE(block.bytes(), 3 * 4 * (capacity + SoaBlock::kPad));
    EXPECT_LE(block.bytes(), 3 * 4 * (capacity + 64));
  }
}

TEST(Soa, ColumnsOfAPowerOfTwoDoNotShareCacheSets) {
  const SoaBlock block(2, 4096);
  const auto distance =
      reinterpret_cast<uintptr_t>(block.floats(1)) - reinterpret_cast<uintptr_t>(block.floats(0));
  EXPECT_NE(distance % 4096, 0u);
}

TEST(Soa, Moves) {
  SoaBlock a(2, 10);
  a.floats(1)[3] = 5;
  SoaBlock b = std::move(a);
  EXPECT_EQ(b.floats(1)[3], 5);
  EXPECT_EQ(SoaBlock().bytes(), 0u);
}

/// Expects columns that do not overlap, with room for a packet past the end.
void expect_apart(const std::vector<const void*>& columns, size_t capacity) {
  for (size_t i = 0; i < columns.size(); ++i) {
    const auto a = reinterpret_cast<uintptr_t>(columns[i]);
    EXPECT_EQ(a % 64, 0u) << i;
    for (size_t j = 0; j < i; ++j) {
      const auto b = reinterpret_cast<uintptr_t>(columns[j]);
      EXPECT_GE(a > b ? a - b : b - a, 4 * (capacity + SoaBlock::kPad)) << i << ", " << j;
    }
  }
}

TEST(Soa, QueuesHaveAllTheirColumns) {
  const RayQueue rays(100);
  const std::vector<const void*> of_rays = {rays.ox,   rays.oy,           rays.oz,
                                            rays.dx,   rays.dy,           rays.dz,
                                            rays.slot, rays.ordered_slot, rays.direction};
  EXPECT_EQ(of_rays.size(), RayQueue::kColumns);
  expect_apart(of_rays, 100);
  EXPECT_EQ(rays.capacity(), 100u);
  EXPECT_EQ(rays.size, 0u);
  EXPECT_GE(rays.bytes(), RayQueue::kColumns * 400);

  const ShadowQueue q(100);
  const std::vector<const void*> of_shadows = {q.ox,   q.oy,           q.oz,        q.dx,      q.dy,
                                               q.dz,   q.tfar,         q.r,         q.g,       q.b,
                                               q.slot, q.ordered_slot, q.direction, q.occluded};
  EXPECT_EQ(of_shadows.size(), ShadowQueue::kColumns);
  expect_apart(of_shadows, 100);
  EXPECT_EQ(q.size, 0u);
  EXPECT_GE(q.bytes(), ShadowQueue::kColumns * 400);

  const HitBuffer hits(100);
  expect_apart({hits.t, hits.u, hits.v, hits.prim, hits.geom, hits.inst}, 100);
  EXPECT_GE(hits.bytes(), 6u * 400);
}

}  // namespace
}  // namespace wavecomb
