// SPDX-License-Identifier: Apache-2.0
#include <algorithm>

#include "lane_testing.h"
#include "wavecomb/core/encoding/hash.h"
#include "wavecomb/core/encoding/morton.h"

namespace wavecomb {
namespace {

using namespace lane_testing;

uint32_t interleave(const std::vector<uint32_t>& v, uint32_t bits) {
  uint32_t code = 0;
  for (uint32_t b = 0; b < bits; ++b)
    for (uint32_t i = 0; i < v.size(); ++i)
      code |= (v[i] >> b & 1u) << (b * static_cast<uint32_t>(v.size()) + i);
  return code;
}

TEST(Morton, InterleavesBits) {
  std::mt19937 rng(1);
  for (int n = 0; n < 20000; ++n) {
    const auto x = static_cast<uint32_t>(rng()), y = static_cast<uint32_t>(rng()),
               z = static_cast<uint32_t>(rng());
    ASSERT_EQ(morton_2(x, y), interleave({x & 0xffff, y & 0xffff}, 16));
    ASSERT_EQ(morton_3(x, y, z), interleave({x & 0x3ff, y & 0x3ff, z & 0x3ff}, 10));
    ASSERT_EQ(compact_bits_2(morton_2(x, y)), x & 0xffff);
    ASSERT_EQ(compact_bits_2(morton_2(x, y) >> 1), y & 0xffff);
  }
}

TEST(Morton, Lanes) {
  for_each_lane_type([]<typename F>() {
    using U = UInt<F>;
    const U x = lane_index<F>() * 2654435761u, y = lane_index<F>() * 40503u + 7u, z = x ^ y;
    for (size_t k = 0; k < kWidth<F>; ++k) {
      ASSERT_EQ(lane(morton_2(x, y), k), morton_2(lane(x, k), lane(y, k)));
      ASSERT_EQ(lane(morton_3(x, y, z), k), morton_3(lane(x, k), lane(y, k), lane(z, k)));
    }
  });
}

/// Inverse of hash_u32. The hash is a bijection, since it has an inverse.
uint32_t unhash(uint32_t x) {
  x ^= x >> 16;
  x *= 0x43021123u;
  x ^= x >> 15 ^ x >> 30;
  x *= 0x1d69e2a5u;
  x ^= x >> 16;
  return x;
}

TEST(Hash, IsABijection) {
  for (uint32_t i = 0; i < 2000000; ++i) {
    const uint32_t x = i * 2654435761u;
    ASSERT_EQ(unhash(hash_u32(x)), x);
  }
}

TEST(Hash, FlipsHalfOfTheBits) {
  // Avalanche: each input bit flips each output bit with probability 1/2, within 5 sigma.
  constexpr int kN = 20000;
  for (uint32_t bit = 0; bit < 32; ++bit) {
    int flips[32] = {}, flips_second[32] = {};
    for (uint32_t i = 0; i < kN; ++i) {
      const uint32_t a = hash_u32(i) ^ hash_u32(i ^ 1u << bit);
      const uint32_t b = hash_u32(i, 77u) ^ hash_u32(i, 77u ^ 1u << bit);
      for (uint32_t o = 0; o < 32; ++o) {
        flips[o] += static_cast<int>(a >> o & 1u);
        flips_second[o] += static_cast<int>(b >> o & 1u);
      }
    }
    for (int o = 0; o < 32; ++o) {
      EXPECT_NEAR(flips[o], kN / 2, 0.04 * kN) << bit << " -> " << o;
      EXPECT_NEAR(flips_second[o], kN / 2, 0.04 * kN) << bit << " -> " << o;
    }
  }
}

TEST(Hash, TwoWordsRarelyCollide) {
  // Hashing 2^18 pairs into 2^32 values gives about n^2 / 2^33 = 8 collisions.
  std::vector<uint32_t> all;
  for (uint32_t a = 0; a < 512; ++a)
    for (uint32_t b = 0; b < 512; ++b) all.push_back(hash_u32(a, b));
  std::sort(all.begin(), all.end());
  const auto collisions = std::distance(std::unique(all.begin(), all.end()), all.end());
  EXPECT_LT(collisions, 25);
  EXPECT_NE(hash_u32(1u, 2u), hash_u32(2u, 1u));
  // No collisions while one 32-bit word is constant.
  for (const uint32_t fixed : {0u, 1u, 12345u, 0xffffffffu})
    for (const bool first : {false, true}) {
      all.clear();
      for (uint32_t i = 0; i < 1u << 20; ++i)
        all.push_back(first ? hash_u32(i, fixed) : hash_u32(fixed, i));
      std::sort(all.begin(), all.end());
      EXPECT_EQ(std::adjacent_find(all.begin(), all.end()), all.end());
    }
}

TEST(Hash, UnitFloat) {
  EXPECT_EQ(unit_float<float>(0u), 0.f);
  EXPECT_EQ(unit_float<float>(0xffu), 0.f);
  EXPECT_EQ(unit_float<float>(0x80000000u), 0.5f);
  EXPECT_EQ(unit_float<float>(0xffffffffu), 0x1.fffffep-1f);
}

TEST(Hash, Lanes) {
  for_each_lane_type([]<typename F>() {
    using U = UInt<F>;
    for (uint32_t i = 0; i < 1000; ++i) {
      const U x = lane_index<F>() * 77777u + i, h = hash_u32<U>(x), h2 = hash_u32<U>(x, U(i));
      const F f = unit_float<F>(h);
      for (size_t k = 0; k < kWidth<F>; ++k) {
        ASSERT_EQ(lane(h, k), hash_u32(lane(x, k)));
        ASSERT_EQ(lane(h2, k), hash_u32(lane(x, k), i));
        ASSERT_EQ(lane(f, k), unit_float<float>(lane(h, k)));
      }
    }
  });
}

}  // namespace
}  // namespace wavecomb
