// SPDX-License-Identifier: Apache-2.0
/// Tests of core/math.h: errors compared with double precision, in units in the last place, and
/// equal results of packets and scalars.
#include "numbers_testing.h"
#include "wavecomb/core/math.h"

#include <functional>

#include "lane_testing.h"
#include "parts.h"

namespace wavecomb {
namespace {

using namespace lane_testing;

using numbers_testing::kPiD;

/// Returns floats in [lo, hi], including both ends: some uniformly distributed, and some at all
/// orders of magnitude.
std::vector<float> cover(float lo, float hi) {
  std::vector<float> x = {lo, hi};
  const size_t n = is_long() ? 400000 : 100000;
  const float step = is_long() ? 1.0001f : 1.0004f;
  for (size_t i = 0; i < n; ++i) {
    x.push_back(static_cast<float>(static_cast<double>(lo) + (static_cast<double>(hi) - lo) *
                                                                 static_cast<double>(i) /
                                                                 static_cast<double>(n)));
  }
  for (float m = 0x1p-126f; m < hi; m *= step) {
    x.push_back(m);
    if (-m >= lo) x.push_back(-m);
  }
  for (float& v : x) v = std::min(std::max(v, lo), hi);
  while (x.size() % 16 != 0) x.push_back(lo);
  return x;
}

double worst_ulps(const std::vector<float>& x, const std::vector<float>& y,
                  const std::function<double(double)>& exact) {
  double worst = 0;
  for (size_t i = 0; i < x.size(); ++i)
    worst = std::max(worst, ulps(y[i], exact(static_cast<double>(x[i]))));
  return worst;
}
double worst_error(const std::vector<float>& x, const std::vector<float>& y,
                   const std::function<double(double)>& exact) {
  double worst = 0;
  for (size_t i = 0; i < x.size(); ++i)
    worst =
        std::max(worst, std::fabs(static_cast<double>(y[i]) - exact(static_cast<double>(x[i]))));
  return worst;
}

TEST(Math, SinCos) {
  const auto sine = [](auto x) { return sincos_2pi(x).sin; };
  const auto cosine = [](auto x) { return sincos_2pi(x).cos; };
  // Reduce the argument, which is exact in turns, in double before multiplying by 2 pi.
  const auto sin_d = [](double x) { return std::sin(2 * kPiD * std::remainder(x, 1.0)); };
  const auto cos_d = [](double x) { return std::cos(2 * kPiD * std::remainder(x, 1.0)); };
  for (const auto& [lo, hi] : {std::pair{-1.f, 1.f}, {-100.f, 100.f}, {-1048575.f, 1048575.f}}) {
    const auto x = cover(lo, hi);
    EXPECT_LE(worst_error(x, map<float>(x, sine), sin_d), 1.2e-7) << hi;
    EXPECT_LE(worst_error(x, map<float>(x, cosine), cos_d), 1.2e-7) << hi;
    expect_lanes_agree(x, sine, "sin");
    expect_lanes_agree(x, cosine, "cos");
  }
  // Measures the relative error near the zeros of sine and cosine.
  const auto x = cover(-0.124f, 0.124f);
  EXPECT_LE(worst_ulps(x, map<float>(x, sine), sin_d), 2.5);
  EXPECT_LE(worst_ulps(x, map<float>(x, cosine), cos_d), 2.5);
  for (const float q : {0.f, 0.25f, 0.5f, 0.75f, 1.f, -0.25f, 1000.5f}) {  // exact at quarters
    EXPECT_EQ(sincos_2pi(q).sin, static_cast<float>(std::round(sin_d(q))));
    EXPECT_EQ(sincos_2pi(q).cos, static_cast<float>(std::round(cos_d(q))));
  }
  for (const float v : x) {
    const auto [s, c] = sincos_2pi(v);
    ASSERT_NEAR(static_cast<double>(s) * s + static_cast<double>(c) * c, 1, 4e-7);
  }
}

TEST(Math, Atan2AllAround) {
  std::vector<float> y, x;
  std::mt19937 rng(3);
  std::uniform_real_distribution<double> angle(-kPiD, kPiD), exponent(-30, 30);
  for (int i = 0; i < 400000; ++i) {
    const double a = angle(rng), r = std::exp(exponent(rng));
    y.push_back(static_cast<float>(r * std::sin(a)));
    x.push_back(static_cast<float>(r * std::cos(a)));
  }
  const auto f = [](auto a, auto b) { return atan2(a, b); };
  const auto result = map<float>(y, x, f);
  double worst = 0;
  for (size_t i = 0; i < x.size(); ++i) {
    worst = std::max(
        worst, ulps(result[i], std::atan2(static_cast<double>(y[i]), static_cast<double>(x[i]))));
  }
  EXPECT_LE(worst, 4);
  expect_lanes_agree(y, x, f, "atan2");
  const auto [a, b] = all_pairs(awkward_floats());
  expect_lanes_agree(a, b, f, "atan2");
  EXPECT_EQ(atan2(0.f, 0.f), 0.f);
  EXPECT_EQ(atan2(0.f, 1.f), 0.f);
  EXPECT_FLOAT_EQ(atan2(0.f, -1.f), kPi);
  EXPECT_FLOAT_EQ(atan2(-0.f, -1.f), -kPi);
  EXPECT_FLOAT_EQ(atan2(1.f, 0.f), kPi / 2);
  EXPECT_FLOAT_EQ(atan2(-1.f, 0.f), -kPi / 2);
  EXPECT_FLOAT_EQ(atan2(1e-40f, 1.f), 1e-40f);
}

TEST(Math, Acos) {
  const auto f = [](auto x) { return acos(x); };
  const auto x = cover(-1.f, 1.f);
  const auto y = map<float>(x, f);
  EXPECT_LE(worst_ulps(x, y, [](double v) { return std::acos(v); }), 5);
  expect_lanes_agree(x, f, "acos");
  expect_lanes_agree(padded(awkward_floats(), 0, 0, 1), f, "acos");
  EXPECT_EQ(acos(1.f), 0.f);
  EXPECT_EQ(acos(1.5f), 0.f);
  EXPECT_FLOAT_EQ(acos(-1.f), kPi);
  EXPECT_FLOAT_EQ(acos(-9.f), kPi);
}

TEST(Math, Exp) {
  const auto f = [](auto x) { return exp(x); };
  const auto x = cover(-87.3f, 88.f);
  EXPECT_LE(worst_ulps(x, map<float>(x, f), [](double v) { return std::exp(v); }), 2);
  expect_lanes_agree(x, f, "exp");
  expect_lanes_agree(padded(awkward_floats(), 1000, -200.f, 200.f), f, "exp");
  EXPECT_EQ(exp(0.f), 1.f);
  EXPECT_EQ(exp(-87.4f), 0.f);
  EXPECT_EQ(exp(-kInf), 0.f);
  EXPECT_EQ(exp(kInf), exp(88.f));
}

TEST(Math, LogOfEveryBinade) {
  std::vector<float> x;
  std::mt19937 rng(4);
  for (int e = -126; e < 128; ++e)
    for (int i = 0; i < 1000; ++i)
      x.push_back(std::ldexp(1 + static_cast<float>(rng() >> 9) * 0x1p-23f, e));
  for (int i = -2000; i < 2000; ++i) x.push_back(1 + static_cast<float>(i) * 0x1p-20f);
  for (const float v : {0x1p-126f, 0x1.fffffep127f, 1.f}) x.push_back(v);
  while (x.size() % 16 != 0) x.push_back(1.f);
  const auto f = [](auto v) { return log(v); };
  const auto f2 = [](auto v) { return log2(v); };
  EXPECT_LE(worst_ulps(x, map<float>(x, f), [](double v) { return std::log(v); }), 2);
  EXPECT_LE(worst_ulps(x, map<float>(x, f2), [](double v) { return std::log2(v); }), 4);
  expect_lanes_agree(x, f, "log");
  expect_lanes_agree(x, f2, "log2");
  expect_lanes_agree(padded(awkward_floats(), 0, 0, 1), f, "log");
  EXPECT_EQ(log(1.f), 0.f);
}

TEST(Math, Pow) {
  std::vector<float> x, y;
  std::mt19937 rng(5);
  std::uniform_real_distribution<float> base(0.001f, 4.f), power(0.f, 8.f);
  for (int i = 0; i < 100000; ++i) {
    x.push_back(base(rng));
    y.push_back(power(rng));
  }
  const auto f = [](auto a, auto b) { return pow(a, b); };
  const auto result = map<float>(x, y, f);
  for (size_t i = 0; i < x.size(); ++i) {
    const double exact = std::pow(static_cast<double>(x[i]), static_cast<double>(y[i]));
    // The error of log(x) grows with the exponent.
    ASSERT_NEAR(result[i] / exact, 1, 4e-7 * (1 + std::fabs(std::log(exact))))
        << x[i] << "^" << y[i];
  }
  expect_lanes_agree(x, y, f, "pow");
  EXPECT_EQ(pow(0.f, 2.f), 0.f);
  EXPECT_EQ(pow(1.f, 5.f), 1.f);
}

}  // namespace
}  // namespace wavecomb
