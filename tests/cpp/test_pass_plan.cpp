// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/render/passes/pass_plan.h"

#include <gtest/gtest.h>

#include <map>

#include "wavecomb/render/passes/pass_runner.h"
#include "wavecomb/render/passes/pixel_order.h"

namespace wavecomb {
namespace {

PassRules adaptive_rules(uint32_t min_spp, uint32_t spp) {
  PassRules rules;
  rules.adaptive = true;
  rules.min_spp = min_spp;
  rules.spp = spp;
  return rules;
}

TEST(PassPlan, ChecksAreWhereTheTableSays) {
  const struct {
    uint32_t min_spp, spp;
    std::vector<uint32_t> checks;
  } cases[] = {
      {16, 16, {16}},
      {1, 100, {16, 32, 48, 64, 80, 96, 100}},
      {17, 64, {32, 48, 64}},
      {16, 512, {16, 32, 48, 64, 80, 96, 112, 128, 160, 192, 224, 256, 320, 384, 448, 512}},
      {1000, 4096, {1008, 1024, 1280, 1536, 1792, 2048, 2560, 3072, 3584, 4096}},
      {4, 8, {8}},
  };
  for (const auto& c : cases) {
    const PassRules rules = adaptive_rules(c.min_spp, c.spp);
    std::vector<uint32_t> found;
    for (uint32_t n = 0; n < c.spp; found.push_back(n)) {
      const uint32_t next = next_check(n, rules);
      ASSERT_GT(next, n);
      for (uint32_t between = n; between < next; ++between)
        ASSERT_EQ(next_check(between, rules), next) << between;
      ASSERT_TRUE(is_check(next, rules)) << next;
      n = next;
    }
    EXPECT_EQ(found, c.checks) << "min " << c.min_spp << ", max " << c.spp;
  }
}

TEST(PassPlan, TargetsAreWhereTheTableSays) {
  PassRules fixed;
  fixed.spp = 100;
  PassRules timed = fixed;
  timed.spp = 1u << 20;
  timed.timed = true;
  PassRules both = adaptive_rules(16, 1024);
  both.timed = true;
  constexpr double kUnbounded = std::numeric_limits<double>::infinity();
  const struct {
    const char* what;
    PassRules rules;
    uint32_t done;
    TimeLeft left;
    uint64_t pixels;
    uint32_t target;
  } cases[] = {
      {"fixed", fixed, 0, {}, 1000, 16},
      {"fixed, last", fixed, 96, {}, 1000, 100},
      {"adaptive looks at checks only", adaptive_rules(40, 1024), 0, {}, 1000, 48},
      {"adaptive", adaptive_rules(40, 1024), 256, {}, 1000, 320},
      {"a pilot, for the speed is not known", timed, 0, {10, 0}, 1000, 1},
      {"doubling", timed, 1, {10, 1e6}, 1000, 2},
      {"doubling", timed, 8, {10, 1e6}, 1000, 16},
      {"no more than a step", timed, 64, {kUnbounded, 1e6}, 1000, 80},
      {"time for 12 at three quarters: 8", timed, 64, {0.016, 1e6}, 1000, 72},
      {"time for less than one", timed, 64, {1e-4, 1e6}, 1000, 65},
      {"no time", timed, 64, {-1, 1e6}, 1000, 65},
      {"fewer pixels, more samples", timed, 64, {0.016, 1e6}, 100, 80},
      {"timed and adaptive stops at checks", both, 24, {kUnbounded, 1e6}, 10, 32},
      {"timed and adaptive", both, 512, {0.016, 1e6}, 1000, 520},
  };
  for (const auto& c : cases)
    EXPECT_EQ(next_target(c.done, c.rules, c.left, c.pixels), c.target) << c.what;
}

TEST(PassPlan, TimedPassesReachEveryCheck) {
  PassRules rules = adaptive_rules(16, 256);
  rules.timed = true;
  std::vector<uint32_t> ends;
  for (uint32_t n = 0; n < rules.spp;) {
    n = next_target(n, rules, {1000, 1e6}, 10);
    ends.push_back(n);
  }
  for (uint32_t check = next_check(0, rules);; check = next_check(check, rules)) {
    EXPECT_NE(std::find(ends.begin(), ends.end(), check), ends.end()) << check;
    if (check == rules.spp) break;
  }
}

/// Converts a plan to pixel -> (first sample, samples), and expects each pixel once.
std::map<uint32_t, std::pair<uint32_t, uint32_t>> by_pixel(const PassPlan& plan) {
  std::map<uint32_t, std::pair<uint32_t, uint32_t>> out;
  for (const PassBatch& b : plan.batches)
    for (size_t i = b.begin; i < b.end; ++i)
      EXPECT_TRUE(out.emplace(plan.pixels[i], std::pair{b.first_sample, b.samples}).second);
  return out;
}

TEST(PassPlan, AllPixelsInMortonOrder) {
  const std::vector<uint32_t> order = morton_pixel_order({0, 0, 5, 3}), none(15, 0);
  const PassPlan plan = plan_pass(order, {0, 0, 5, 3}, none, {.target = 16});
  EXPECT_EQ(plan.pixels, order);
  ASSERT_EQ(plan.batches.size(), 1u);
  EXPECT_EQ(plan.samples(), 15u * 16);
}

TEST(PassPlan, TakesActivePixelsBelowTheTarget) {
  const std::vector<uint32_t> order = morton_pixel_order({0, 0, 3, 2});
  const std::vector<uint32_t> samples = {32, 48, 64, 16, 64, 32};
  const std::vector<uint8_t> active = {1, 1, 1, 1, 0, 0};
  const auto plan =
      by_pixel(plan_pass(order, {0, 0, 3, 2}, samples, {.target = 64, .active = active}));
  const auto at = [](uint32_t x, uint32_t y) { return x | y << 16; };
  const std::map<uint32_t, std::pair<uint32_t, uint32_t>> expected = {
      {at(0, 0), {32, 32}}, {at(1, 0), {48, 16}}, {at(0, 1), {16, 48}}};
  EXPECT_EQ(plan, expected);
  EXPECT_TRUE(
      plan_pass(order, {0, 0, 3, 2}, std::vector<uint32_t>(6, 64), {.target = 64, .active = active})
          .batches.empty());
}

TEST(PassPlan, ProgressivePassesDoubleUpToTheStep) {
  PassRules rules;
  rules.spp = 100;
  rules.progressive = true;
  std::vector<uint32_t> targets;
  for (uint32_t done = 0; done < rules.spp;)
    targets.push_back(done = next_target(done, rules, {}, 1000));
  EXPECT_EQ(targets, (std::vector<uint32_t>{1, 2, 4, 8, 16, 32, 48, 64, 80, 96, 100}));
}

TEST(PassPlan, RegionsAreRenderedAloneAndInTheSameOrder) {
  const std::vector<uint32_t> all = morton_pixel_order({0, 0, 150, 90});
  const Region region{60, 10, 140, 70};
  std::vector<uint32_t> within;
  for (const uint32_t pixel : all)
    if (region.contains(pixel & 0xffffu, pixel >> 16)) within.push_back(pixel);
  EXPECT_EQ(morton_pixel_order(region), within);
  EXPECT_EQ(within.size(), region.pixels());
}

TEST(WaveGroups, CoverThePlanOnceAndFillWaves) {
  const std::vector<uint32_t> order = morton_pixel_order({0, 0, 100, 70});
  for (const uint32_t wave_size : {64u, 1000u, 4096u, 65536u})
    for (const uint32_t samples : {1u, 16u, 100u, 5000u})
      for (const uint32_t threads : {1u, 2u, 16u}) {
        const PassPlan plan = plan_pass(order, {0, 0, 100, 70}, std::vector<uint32_t>(7000, 32),
                                        {.target = 32 + samples});
        size_t pixels = 0;
        const std::vector<WaveGroup> groups = wave_groups(plan, wave_size, threads);
        for (const WaveGroup& g : groups) {
          ASSERT_EQ(g.pixels, plan.pixels.data() + pixels);
          ASSERT_GT(g.wave_samples, 0u);
          ASSERT_LE(g.pixel_count * g.wave_samples, wave_size);
          ASSERT_EQ(g.first_sample, 32u);
          ASSERT_EQ(g.samples, samples);
          pixels += g.pixel_count;
        }
        EXPECT_EQ(pixels, 7000u);
        if (uint64_t{7000} * samples < uint64_t{wave_size} * threads * 8) continue;
        EXPECT_GE(groups[0].pixel_count * groups[0].wave_samples, wave_size * 3 / 4);
      }
}

TEST(WaveGroups, FewPixelsKeepAllWorkersBusy) {
  const std::vector<uint32_t> order = morton_pixel_order({0, 0, 5, 4});
  const PassPlan plan =
      plan_pass(order, {0, 0, 5, 4}, std::vector<uint32_t>(20, 0), {.target = 4096});
  EXPECT_GE(wave_groups(plan, 65536, 4).size(), 10u);
}

}  // namespace
}  // namespace wavecomb
