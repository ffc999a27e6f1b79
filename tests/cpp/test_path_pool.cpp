// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/aov/path_aovs.h"
#include "wavecomb/film/film.h"
#include "wavecomb/path/path_pool.h"

#include <algorithm>
#include <array>
#include <numeric>

#include "lane_testing.h"

namespace wavecomb {
namespace {

using namespace lane_testing;

constexpr uint32_t kSlots = 53;

/// Unique value for word k of the path in `slot`.
float word(uint32_t slot, uint32_t k) {
  return static_cast<float>(100 * slot + k + 1);
}
template <typename F>
PathRow<F> numbered_path(const UInt<F>& slot) {
  const auto at = [&](uint32_t k) { return F(Int<F>(slot * 100u + k + 1u)); };
  return {{at(0), at(1), at(2)},
          {at(3), at(4), at(5)},
          {at(6), at(7), at(8)},
          at(9),
          at(10),
          at(11),
          at(12),
          // Arbitrary bits including NaN: keys are hashes.
          {slot * 100u + 0x7f800001u, slot * 100u + 0xff800001u},
          slot * 100u + 0x7fc00001u};
}

/// Visits all slots in random order, `kWidth` at a time, with a random mask per packet.
template <typename F, typename Function>
void for_each_packet_of_slots(uint32_t seed, const Function& f) {
  std::mt19937 rng(seed);
  std::vector<uint32_t> slots(kSlots);
  std::iota(slots.begin(), slots.end(), 0u);
  std::shuffle(slots.begin(), slots.end(), rng);
  slots.resize(kSlots + 16, 0x7fffff00u / 16);
  for (size_t i = 0; i < kSlots; i += kWidth<F>)
    f(load<UInt<F>>(slots.data() + i), first_lanes<F>(kSlots - i));
}

TEST(PathPool, PathsComeBackFromTheirSlots) {
  for_each_lane_type([]<typename F>() {
    using U = UInt<F>;
    const PathPool pool(kSlots, false);
    for_each_packet_of_slots<F>(1, [&](const U& slot, const Mask<F>& active) {
      store_row<PathRow, F>(pool.paths, slot, numbered_path<F>(slot), active);
    });
    for (uint32_t s = 0; s < kSlots; ++s) {
      const float* row = pool.paths + s * kRowWords<PathRow>;
      for (uint32_t k = 0; k < 13; ++k) ASSERT_EQ(row[k], word(s, k)) << s << ", " << k;
      ASSERT_EQ(std::bit_cast<uint32_t>(row[13]), 100 * s + 0x7f800001u);
      ASSERT_EQ(std::bit_cast<uint32_t>(row[14]), 100 * s + 0xff800001u);
      ASSERT_EQ(std::bit_cast<uint32_t>(row[15]), 100 * s + 0x7fc00001u);
    }
    ASSERT_TRUE(std::all_of(pool.shadows, pool.radiance + kSlots * kRadianceWords,
                            [](float x) { return x == 0; }));
    for_each_packet_of_slots<F>(2, [&](const U& slot, const Mask<F>& active) {
      const PathRow<F> p = load_row<PathRow, F>(pool.paths, slot, active),
                       q = numbered_path<F>(slot);
      const F a[] = {p.o.x,       p.o.y,          p.o.z,          p.d.x,          p.d.y,
                     p.d.z,       p.throughput.x, p.throughput.y, p.throughput.z, p.pdf,
                     p.eta_scale, p.cone_width,   p.cone_spread};
      const F b[] = {q.o.x,       q.o.y,          q.o.z,          q.d.x,          q.d.y,
                     q.d.z,       q.throughput.x, q.throughput.y, q.throughput.z, q.pdf,
                     q.eta_scale, q.cone_width,   q.cone_spread};
      const uint32_t all = lane_bits<F>(active);
      for (size_t k = 0; k < std::size(a); ++k)
        ASSERT_EQ(lane_bits<F>(Mask<F>(a[k] == b[k])) & all, all) << k;
      ASSERT_EQ(lane_bits<F>(Mask<F>(p.key.pixel_hash == q.key.pixel_hash)) & all, all);
      ASSERT_EQ(lane_bits<F>(Mask<F>(p.key.sample == q.key.sample)) & all, all);
      ASSERT_EQ(lane_bits<F>(Mask<F>(p.receiver == q.receiver)) & all, all);
    });
  });
}

TEST(PathPool, RadianceAddsUpInActiveLanesOnly) {
  for_each_lane_type([]<typename F>() {
    using U = UInt<F>;
    const PathPool pool(kSlots, false);
    std::vector<std::array<float, 3>> expected(kSlots, {0, 0, 0});
    for (uint32_t round = 0; round < 3; ++round)
      for_each_packet_of_slots<F>(round, [&](const U& slot, const Mask<F>& active) {
        // Every third slot is skipped in each round.
        const Mask<F> lit = active & Mask<F>((slot + round) % 3u != U(0u));
        const F x = F(Int<F>(slot)) + 0.125f;
        add_radiance<F>(pool.radiance, slot, {x, F(2.f * x), F(3.f * x)}, lit);
        for (size_t k = 0; k < kWidth<F>; ++k)
          if ((lane_bits<F>(lit) >> k & 1u) != 0)
            for (size_t c = 0; c < 3; ++c)
              expected[lane(slot, k)][c] += static_cast<float>(c + 1) * lane(x, k);
      });
    for (uint32_t s = 0; s < kSlots; ++s) {
      const float* row = pool.radiance + s * kRadianceWords;
      for (size_t c = 0; c < 3; ++c) ASSERT_EQ(row[c], expected[s][c]) << s;
    }
    ASSERT_TRUE(std::all_of(pool.paths, pool.radiance, [](float x) { return x == 0; }));
  });
}

TEST(PathPool, BlocksOfRows) {
  const PathPool plain(100, false), cold(100, true);
  EXPECT_EQ(plain.cold, nullptr);
  ASSERT_NE(cold.cold, nullptr);
  EXPECT_LT(plain.bytes(), cold.bytes());
  EXPECT_GE(plain.bytes(), 400u * (kRowWords<PathRow> + kRowWords<ShadowRow> + kRadianceWords));
  // Paths and shadow rays are aligned to cache lines.
  EXPECT_EQ(reinterpret_cast<uintptr_t>(plain.paths) % 64, 0u);
  EXPECT_EQ(reinterpret_cast<uintptr_t>(plain.shadows) % 64, 0u);
  EXPECT_EQ(plain.shadows - plain.paths, 100 * ptrdiff_t{kRowWords<PathRow>});
  EXPECT_EQ(plain.radiance - plain.shadows, 100 * ptrdiff_t{kRowWords<ShadowRow>});
  // Unused features take no memory: a path, its shadow ray and its radiance take 144 bytes.
  EXPECT_LE(plain.bytes(), 100u * 144 + 4 * (SoaBlock::kPad + 32));
}

TEST(PathPool, ColdFieldsComeBackOneByOne) {
  for_each_lane_type([]<typename F>() {
    using U = UInt<F>;
    const PathPool pool(kSlots, true);
    for_each_packet_of_slots<F>(3, [&](const U& slot, const Mask<F>& active) {
      scatter_field<F>(pool.cold, &PathColdRow<float>::time, slot, F(Int<F>(slot)), active);
      scatter_field<F>(pool.cold, &PathColdRow<float>::link, slot, U(slot + 0x80000000u), active);
    });
    for (uint32_t s = 0; s < kSlots; ++s) {
      const auto row = load_row<PathColdRow, float>(pool.cold, s, true);
      EXPECT_EQ(row.time, static_cast<float>(s));
      EXPECT_EQ(row.link, s + 0x80000000u);
    }
  });
}

TEST(PathAovs, OnlyWhatIsAskedForTakesRoom) {
  const PathAovs none(100, {AovSet{0}}, nullptr), usual(100, {AovSet{}}, nullptr);
  const PathAovs all(100, {AovSet{AovSet::kAll}, 3}, nullptr);
  EXPECT_EQ(none.bytes(), 0u);
  EXPECT_FALSE(none.wants_hits() || none.wants_vertex(0) || none.wants_lights() ||
               none.wants_cost());
  EXPECT_TRUE(usual.wants_vertex(0));
  EXPECT_FALSE(usual.wants_vertex(1));
  EXPECT_LT(usual.bytes(), all.bytes());
  EXPECT_TRUE(all.wants_vertex(5) && all.wants_cost());
  EXPECT_TRUE(all.wanted<float>(0).wants_uv);
  EXPECT_FALSE(all.wanted<float>(1).wants_uv);
}

TEST(PathAovs, TechniquesKeepApart) {
  const uint32_t slot = 2;
  const PathAovs none(8, {AovSet{}}, nullptr);
  EXPECT_FALSE(none.wants(Technique::kEmitter) || none.wants(Technique::kVolume) ||
               none.wants(Technique::kLightSample) || none.wants(Technique::kConnection));
  const PathAovs aovs(8, {AovSet{static_cast<uint32_t>(Aov::kByBounces)}}, nullptr);
  EXPECT_FALSE(aovs.wants(Technique::kEmitter) || aovs.wants(Technique::kVolume));
  EXPECT_TRUE(aovs.wants(Technique::kLightSample) && aovs.wants(Technique::kConnection));
  aovs.light<Technique::kEmitter, float>({0, slot, {4.f, 4.f, 4.f}}, kNoLight, true);
  aovs.light<Technique::kLightSample, float>({0, slot, {1.f, 2.f, 3.f}}, kNoGroup, true);
  aovs.light<Technique::kConnection, float>({1, slot, {1.f, 1.f, 1.f}}, 0, true);
  Film film(1, 1, {AovSet{static_cast<uint32_t>(Aov::kByBounces)}});
  std::array<float, 3 * kRadianceWords> radiance{};
  store_row<RadianceRow, float>(radiance.data(), slot, {{6.f, 7.f, 8.f}}, true);
  aovs.resolve(film.aovs(), 0, slot, slot + 1, radiance.data());
  const double* by_bounces = film.aovs().sums(Aov::kByBounces, 0);
  EXPECT_EQ(by_bounces[0], 4.0);
  EXPECT_EQ(by_bounces[1], 4.0);
  EXPECT_EQ(by_bounces[2], 4.0);
}

TEST(PathAovs, LightGroupsKeepApart) {
  const PathAovs aovs(8, {AovSet{static_cast<uint32_t>(Aov::kLightGroups)}, 3}, nullptr);
  const auto add = [&](uint32_t slot, uint32_t group, const Color<float>& c, bool active) {
    aovs.light<Technique::kLightSample, float>({0, slot, c}, group, active);
  };
  add(2, 1, {1.f, 2.f, 3.f}, true);
  add(2, 1, {1.f, 0.f, 0.f}, true);
  add(2, kNoGroup, {9.f, 9.f, 9.f}, true);
  add(3, 0, {9.f, 9.f, 9.f}, false);
  for (uint32_t row = 0; row < 8 * 3; ++row) {
    const Color<float> sum = load_row<RadianceRow, float>(aovs.group_rows(), row, true).sum;
    const bool lit = row == 2 * 3 + 1;
    EXPECT_EQ(sum.x, lit ? 2.f : 0.f) << row;
    EXPECT_EQ(sum.y, lit ? 2.f : 0.f) << row;
    EXPECT_EQ(sum.z, lit ? 3.f : 0.f) << row;
  }
}

}  // namespace
}  // namespace wavecomb
