// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/core/soa.h"

#include <gtest/gtest.h>

#include <utility>

#include "wavecomb/integrate/path_pool.h"
#include "wavecomb/schedule/ray_queue.h"

namespace wavecomb {
namespace {

TEST(Soa, ColumnsAreAlignedZeroAndRoomy) {
  for (const size_t capacity : {1u, 15u, 16u, 17u, 1000u, 4096u}) {
    const SoaBlock block(3, capacity);
    for (size_t c = 0; c < 3; ++c) {
      EXPECT_EQ(reinterpret_cast<uintptr_t>(block.floats(c)) % 64, 0u);
      EXPECT_EQ(reinterpret_cast<void*>(block.floats(c)), block.uints(c));
      // A packet may start at any index below the capacity.
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

TEST(Soa, QueuesHaveAllTheirColumns) {
  RayQueue rays(100);
  float* const floats[] = {rays.ox,           rays.oy,  rays.oz,           rays.dx,
                           rays.dy,           rays.dz,  rays.throughput_r, rays.throughput_g,
                           rays.throughput_b, rays.pdf, rays.eta_scale,    rays.cone_width,
                           rays.cone_spread};
  EXPECT_EQ(std::size(floats) + 2, RayQueue::kColumns);
  for (size_t i = 0; i < std::size(floats); ++i)
    for (size_t j = 0; j < i; ++j) EXPECT_NE(floats[i], floats[j]);
  EXPECT_NE(rays.slot, rays.alive);
  EXPECT_EQ(rays.capacity(), 100u);
  EXPECT_EQ(rays.size, 0u);

  const PathPool plain(100, false), aovs(100, true);
  EXPECT_FALSE(plain.has_aovs);
  EXPECT_EQ(plain.albedo_r, nullptr);
  EXPECT_TRUE(aovs.has_aovs);
  EXPECT_NE(aovs.depth, nullptr);
  EXPECT_LT(plain.bytes(), aovs.bytes());
  EXPECT_GE(HitBuffer(100).bytes(), 6u * 400);
  EXPECT_GE(ShadowQueue(100).bytes(), ShadowQueue::kColumns * 400);
}

}  // namespace
}  // namespace wavecomb
