// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/light/calibration/balance.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>

namespace wavecomb {
namespace {

/// Samples of one part of the lights: the selection probability ("share") of the part, and a pair
/// of values for each vertex that selected the part. The pair is the contribution and the bounce
/// density, each divided by the density of the light sample.
struct Samples {
  double share;
  std::vector<std::pair<double, double>> found;
};

/// Returns the balanced shares for identical vertices that choose each part in proportion to its
/// share.
std::vector<double> balanced(const std::vector<Samples>& parts, const std::vector<double>& power) {
  std::vector<double> shares;
  for (const Samples& part : parts) shares.push_back(part.share);
  LightBalance balance(shares, 1);
  for (size_t i = 0; i < parts.size(); ++i) {
    const double p = parts[i].share;
    for (long k = 0; k < std::lround(100 * p); ++k)
      for (const auto& [a, r] : parts[i].found) balance.add(0, i, a / (p + r), p / (p + r));
  }
  return balance.shares(power);
}

/// Returns the shares without the minimum that every part gets.
std::vector<double> without_floor(std::vector<double> shares, const std::vector<double>& power) {
  const auto n = static_cast<double>(shares.size());
  for (size_t i = 0; i < shares.size(); ++i)
    shares[i] = (shares[i] - LightBalance::kFloor * (0.5 / n + 0.5 * power[i])) /
                (1 - LightBalance::kFloor);
  return shares;
}

TEST(LightBalance, IsTheSquareRootOfTheSecondMoment) {
  const std::vector<double> power{0.9, 0.05, 0.05};
  const auto shares = without_floor(balanced({{0.5, {{4, 0}, {4, 0}, {4, 0}, {4, 0}}},
                                              {0.2, {{1, 0}, {1, 0}, {1, 0}, {1, 0}}},
                                              {0.3, {{2, 0}, {0, 0}, {0, 0}, {0, 0}}}},
                                             power),
                                    power);
  EXPECT_NEAR(shares[0], 4.0 / 6, 1e-3);
  EXPECT_NEAR(shares[1], 1.0 / 6, 1e-3);
  EXPECT_NEAR(shares[2], 1.0 / 6, 1e-3);
}

TEST(LightBalance, WhatBouncesFindHasTheFloor) {
  const std::vector<double> power{0.8, 0.2};
  const double floor = LightBalance::kFloor * (0.25 + 0.4);
  // Tests uniform domes that are dimmer or brighter than the second light. The contribution of a
  // dome sample is the radiance times the bounce density, and half of the dome is below the
  // horizon.
  for (const double radiance : {0.05, 0.5, 2.0}) {
    const auto shares =
        balanced({{0.6, {{radiance * 2, 2}, {0, 0}}}, {0.4, {{0.5, 0.01}, {0.5, 0.01}}}}, power);
    EXPECT_NEAR(shares[0], floor, 0.005) << radiance;
    EXPECT_NEAR(shares[0] + shares[1], 1, 1e-12);
  }
  // A dome with a sun gets a larger share, since bounces rarely hit the sun.
  EXPECT_GT(balanced({{0.6, {{0.4, 2}, {30, 0.001}}}, {0.4, {{0.5, 0.01}, {0.5, 0.01}}}}, power)[0],
            0.5);
}

TEST(LightBalance, NoOtherSharesNearByHaveLess) {
  std::mt19937 rng(7);
  std::uniform_real_distribution<double> uniform(0, 1);
  constexpr size_t kSamples = 20;
  for (int round = 0; round < 20; ++round) {
    std::vector<Samples> parts(4);
    for (Samples& part : parts) {
      part.share = 0.25;
      const double scale = std::exp2(3 * uniform(rng) - 3), ratio = std::exp2(8 * uniform(rng) - 6);
      for (size_t i = 0; i < kSamples; ++i)
        part.found.push_back({scale * uniform(rng), ratio * uniform(rng)});
    }
    double moment = 0;
    const auto variance = [&](const std::vector<double>& p) {
      double lights = 0, bounces = 0;
      moment = 0;
      for (size_t i = 0; i < 4; ++i)
        for (const auto& [a, r] : parts[i].found) {
          moment += a * a / (p[i] + r) / kSamples;
          lights += p[i] * a / (p[i] + r) / kSamples;
          bounces += a * r / (p[i] + r) / kSamples;
        }
      return moment - lights * lights - bounces * bounces;
    };
    const std::vector<double> power(4, 0.25);
    std::vector<double> shares = without_floor(balanced(parts, power), power);
    for (double& share : shares) share = std::max(share, 0.004);
    const double least = variance(shares), slack = 0.004 * moment;
    for (int i = 0; i < 200; ++i) {
      std::vector<double> other(4);
      double sum = 0;
      for (size_t k = 0; k < 4; ++k)
        sum += other[k] = std::max(0.004, shares[k] + 0.1 * (uniform(rng) - 0.5));
      for (double& p : other) p /= sum;
      EXPECT_GT(variance(other), least - slack) << round;
    }
  }
}

TEST(LightBalance, OrderDoesNotMatter) {
  std::mt19937 rng(3);
  std::uniform_real_distribution<double> uniform(0, 1);
  struct Choice {
    size_t cell, part;
    double value, weight;
  };
  std::vector<Choice> choices(5000);
  for (Choice& c : choices)
    c = {rng() % 40, rng() % 3, std::exp2(20 * uniform(rng) - 15), std::exp2(-8 * uniform(rng))};
  const std::vector<double> power{0.2, 0.3, 0.5};
  std::vector<double> expected;
  for (int round = 0; round < 4; ++round) {
    LightBalance balance(power, 40);
    for (const Choice& c : choices) balance.add(c.cell, c.part, c.value, c.weight);
    const std::vector<double> shares = balance.shares(power);
    if (round == 0) expected = shares;
    EXPECT_EQ(shares, expected);
    std::shuffle(choices.begin(), choices.end(), rng);
  }
}

TEST(LightBalance, EndsWithSharesWhateverCame) {
  const std::vector<double> power{0.5, 0.3, 0.2};
  EXPECT_EQ(LightBalance(power, 1).shares(power), power);
  constexpr double kInfinite = std::numeric_limits<double>::infinity();
  constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
  const double values[] = {0, 1e-30, 1e-3, 1, 1e30, 1e300, -1, kInfinite, kNaN};
  const double weights[] = {0, 1e-30, 0.5, 1, 2, -1, kNaN};
  for (const double value : values) {
    for (const double weight : weights) {
      LightBalance balance(power, 2);
      for (int i = 0; i < 100; ++i) balance.add(0, 1, value, weight);
      balance.add(1, 0, value, weight);
      double sum = 0;
      for (const double share : balance.shares(power)) {
        EXPECT_GE(share, LightBalance::kFloor / 6) << value << " " << weight;
        sum += share;
      }
      EXPECT_NEAR(sum, 1, 1e-12) << value << " " << weight;
    }
  }
}

TEST(NodeBalance, FollowsWhatIsBelow) {
  EXPECT_EQ(NodeBalance().odds(), 1.f);
  NodeBalance few, even, blocked, stronger, broken;
  for (int i = 0; i < 20; ++i) few.add(true, 0.5, 1, 1);
  for (int i = 0; i < 2000; ++i) {
    even.add(i % 2 == 0, 0.5, 1, 1);
    if (i % 2 == 0) blocked.add(true, 0.5, 1, 1);
    stronger.add(i % 2 == 0, 0.5, i % 2 == 0 ? 4 : 1, 1);
    broken.add(true, 0.5, std::numeric_limits<double>::quiet_NaN(), 1);
  }
  EXPECT_EQ(few.odds(), 1.f);
  EXPECT_EQ(even.odds(), 1.f);
  EXPECT_EQ(blocked.odds(), 8.f);
  EXPECT_NEAR(stronger.odds(), 4.f, 1e-4f);
  EXPECT_EQ(broken.odds(), 1.f);
}

}  // namespace
}  // namespace wavecomb
