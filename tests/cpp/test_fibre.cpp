// SPDX-License-Identifier: Apache-2.0
/// Tests of the lobes of hair fibres in the program "hair".
#include <gtest/gtest.h>

#include <array>
#include <bit>
#include <cmath>
#include <vector>

#include "bsdf_testing.h"
#include "parts.h"
#include "wavecomb/material/programs/hair.h"

namespace wavecomb {
namespace {

using bsdf_testing::direction;
using bsdf_testing::furnace;
using bsdf_testing::kPiD;
using bsdf_testing::kronecker;
using chi_square::Battery;
using chi_square::Draw;
using chi_square::Place;
using chi_square::Random;
using Vec = Vec3<float>;
using Hair = HairBsdf<float>;

struct Look {
  const char* name;
  float along, about;  ///< roughnesses
  Vec color{1, 1, 1};
  float tilt = 0;
  std::array<float, 3> tint{1, 1, 1};
  float scale_tt = 0.5f, scale_trt = 2;
};

Hair hair(const Look& look) {
  SpecificShadingParams<float> p{};
  static_cast<ShadingParams<float>&>(p) = bsdf_testing::plain_params();
  p.base_color = look.color;
  p.roughness = look.along;
  p.ior = 1.55f;
  p.own = {look.about,   look.scale_tt, look.scale_trt, look.tilt,
           look.tint[0], look.tint[1],  look.tint[2]};
  return Hair(p, false);
}

std::vector<Look> looks() {
  return {{"usual", 0.3f, 0.3f},
          {"brown", 0.2f, 0.4f, {0.4f, 0.2f, 0.1f}, 2},
          {"black", 0.25f, 0.3f, {0.01f, 0.005f, 0.002f}},
          {"rough", 0.9f, 0.9f, {0.9f, 0.7f, 0.5f}},
          {"smooth", 0.1f, 0.12f, {0.8f, 0.6f, 0.4f}, -5},
          {"tinted", 0.4f, 0.5f, {0.6f, 0.6f, 0.6f}, 3, {0.5f, 0.2f, 0.9f}, 0.8f, 1.2f}};
}

/// Returns the direction wo for the given sine of theta and the offset h of the hit from the centre
/// line of the fibre.
Vec seen_at(double sine, double h) {
  const double across = std::sqrt(1 - sine * sine);
  return {static_cast<float>(sine), static_cast<float>(across * h),
          static_cast<float>(across * std::sqrt(1 - h * h))};
}
std::vector<Vec> views() {
  std::vector<Vec> all;
  for (const double sine : {-0.9, 0.0, 0.5})
    for (const double h : {-0.95, -0.3, 0.0, 0.6}) all.push_back(seen_at(sine, h));
  return all;
}

/// Returns the direction of a chart point. The chart coordinates are sin theta and the azimuth
/// around the fibre, so the chart preserves solid angle.
Vec wi_at(const Place& p) {
  const double across = std::sqrt(std::max(0.0, 1 - p.x * p.x));
  return {static_cast<float>(p.x), static_cast<float>(across * std::sin(p.y)),
          static_cast<float>(across * std::cos(p.y))};
}

TEST(Fibre, SamplesFollowTheirDensity) {
  Battery battery("hair");
  for (const Look& look : looks()) {
    const Hair bsdf = hair(look);
    const std::vector<Vec> few{seen_at(0.4, -0.5)};
    for (const Vec& wo : is_long() ? views() : few) {
      chi_square::Case c;
      c.name = std::string(look.name) + " " + std::to_string(wo.x) + " " + std::to_string(wo.y);
      c.charts = {{-1, 1, -kPiD, kPiD}};
      c.density = [&bsdf, wo](const Place& p) {
        return static_cast<double>(bsdf.eval(wo, wi_at(p)).pdf);
      };
      c.draw = [&bsdf, wo](Random& random, bool) {
        const float l = random(), u = random(), v = random();
        const BsdfSample<float> s = bsdf.sample(wo, l, u, v);
        if (!(s.pdf > 0)) return Draw::nothing();
        const BsdfEval<float> e = bsdf.eval(wo, s.wi);
        const bool agrees = std::abs(e.pdf - s.pdf) <= 1e-3f * e.pdf &&
                            std::abs(s.weight.x * s.pdf - e.f_cos.x) <= 1e-3f * e.f_cos.x;
        return Draw::at({0, static_cast<double>(s.wi.x),
                         std::atan2(static_cast<double>(s.wi.y), static_cast<double>(s.wi.z))},
                        agrees);
      };
      battery.run(c);
    }
  }
  battery.judge();
}

TEST(Fibre, ReflectsAllLightWithoutAbsorption) {
  size_t index = 0;
  for (Look look : looks()) {
    look.color = Vec(1, 1, 1);
    look.tint = {1, 1, 1};
    const Hair bsdf = hair(look);
    for (const Vec& wo : views()) {
      if (!includes_case(index++, 5)) continue;
      // Integrate once by importance sampling and once with uniform directions, which do not use
      // the density.
      EXPECT_NEAR(furnace(bsdf, wo, 5000), 1, 0.005) << look.name << " " << wo.x << " " << wo.y;
      if (look.along < 0.2f) continue;
      double sum = 0, mass = 0;
      constexpr int kSide = 160;
      for (int i = 0; i < kSide; ++i)
        for (int k = 0; k < kSide; ++k) {
          const auto e = bsdf.eval(
              wo, wi_at({0, (2 * i + 1.0) / kSide - 1, kPiD * ((2 * k + 1.0) / kSide - 1)}));
          sum += static_cast<double>(e.f_cos.y);
          mass += static_cast<double>(e.pdf);
        }
      EXPECT_NEAR(sum * 4 * kPiD / (kSide * kSide), 1, 0.005) << look.name << " " << wo.x;
      EXPECT_NEAR(mass * 4 * kPiD / (kSide * kSide), 1, 0.005) << look.name << " " << wo.x;
    }
  }
}

TEST(Fibre, AbsorptionAndTintsTakeLight) {
  size_t index = 0;
  for (const Look& look : looks())
    for (const Vec& wo : views()) {
      if (!includes_case(index++, 5)) continue;
      EXPECT_LE(furnace(hair(look), wo, 2000), 1.005) << look.name;
    }
  Look mute{"mute", 0.3f, 0.3f};
  mute.tint = {0, 0, 0};
  const BsdfSample<float> s = hair(mute).sample(seen_at(0.1, 0.2), 0.3f, 0.4f, 0.5f);
  EXPECT_EQ(s.pdf, 0.f);
  EXPECT_TRUE(is_black(s.weight));
}

// The direction wo determines the offset h of the hit on the fibre. Therefore f is reciprocal only
// for pairs of directions with theta_i = -theta_o, evaluated at mirrored offsets.
TEST(Fibre, IsReciprocalAsFarAsItsModelIs) {
  for (Look look : looks()) {
    look.tilt = 0;
    const Hair bsdf = hair(look);
    for (const double sine : {0.0, 0.4, 0.8})
      for (const double h : {0.0, 0.3, 0.9})
        for (uint32_t i = 0; i < 20; ++i) {
          const double phi = 2 * kPiD * static_cast<double>(kronecker(i).x);
          const Vec wo = seen_at(sine, h), back = seen_at(-sine, -h);
          const auto about = [&](const Vec& w, double turn, double x) {
            const double a = std::atan2(static_cast<double>(w.y), static_cast<double>(w.z));
            return wi_at({0, x, a + turn});
          };
          const float there = bsdf.eval(wo, about(wo, phi, -sine)).f_cos.x;
          const float here = bsdf.eval(back, about(back, -phi, sine)).f_cos.x;
          EXPECT_NEAR(there, here, 1e-3f * there + 1e-6f) << look.name << " " << sine << " " << h;
        }
  }
}

// Lobes in double precision, computed by the formulas of the papers.
TEST(Fibre, LobesAreThoseOfThePaper) {
  const auto bessel = [](double x) {
    double sum = 0, term = 1;
    for (int k = 1; k < 400; ++k) {
      sum += term;
      term *= x * x / (4.0 * k * k);
    }
    return sum;
  };
  for (const double x : {0.0, 0.1, 1.0, 3.7, 3.8, 10.0, 60.0})
    EXPECT_NEAR(static_cast<double>(scaled_bessel_i0(static_cast<float>(x))),
                bessel(x) * std::exp(-x), 1e-6)
        << x;
  for (const double v : {0.02, 0.3, 4.0})
    for (const double a : {-1.2, 0.1, 0.9})
      for (const double b : {-0.8, 0.0, 1.3}) {
        const double m = std::exp(-std::sin(a) * std::sin(b) / v) *
                         bessel(std::cos(a) * std::cos(b) / v) / (2 * v * std::sinh(1 / v));
        const auto f = [](double x) { return static_cast<float>(x); };
        const double ours = static_cast<double>(LongitudinalLobe<float>(f(v)).density(
            f(std::sin(a)), f(std::cos(a)), f(std::sin(b)), f(std::cos(b))));
        EXPECT_NEAR(ours, m, 2e-4 * m + 1e-12) << v << " " << a << " " << b;
      }
  // The divisor that converts colour to absorption, computed by hand for one roughness: 5.969 -
  // 0.0645 + 0.22788 - 0.28971 + ...
  EXPECT_NEAR(fibre_color_divisor(0.3f), 5.88841, 1e-4);
  EXPECT_NEAR(fibre_variance(0.3f), 0.084611, 1e-5);
  EXPECT_NEAR(fibre_scale(0.3f), 0.1171598, 1e-6);
}

// Values of eval and pdf of Mitsuba 3.9.1's `hair` with the same parameters: sigma_a 0.06, 0.2 and
// 0.6, int_ior 1.55. Mitsuba's fibre lies along y of the local frame.
// tests/statistics/test_hair_mitsuba.py compares images.
TEST(Fibre, AgreesWithMitsuba) {
  struct Value {
    float along, about, tilt;
    Vec wo, wi, f_cos;
    float pdf;
  };
  const Value values[] = {
      {0.3f,
       0.3f,
       0.0f,
       {0.81069f, -0.0189146f, 0.585171f},
       {0.316927f, -0.030651f, -0.947954f},
       {6.96297e-05f, 2.54935e-05f, 1.48192e-06f},
       5.01437e-05f},
      {0.3f,
       0.3f,
       0.0f,
       {-0.131609f, 0.30107f, 0.944477f},
       {-0.526773f, -0.220527f, 0.820901f},
       {0.0102738f, 0.0101292f, 0.00999408f},
       0.0145221f},
      {0.3f,
       0.3f,
       0.0f,
       {-0.847712f, -0.0793499f, 0.524488f},
       {0.236704f, 0.0750866f, 0.968676f},
       {0.0460628f, 0.0293552f, 0.014456f},
       0.0482708f},
      {0.3f,
       0.3f,
       0.0f,
       {0.499534f, 0.272429f, 0.822343f},
       {-0.282216f, -0.200111f, 0.938248f},
       {0.0949942f, 0.0944614f, 0.0939563f},
       0.137627f},
      {0.2f,
       0.5f,
       2.0f,
       {-0.141374f, 0.585533f, 0.798226f},
       {-0.880954f, -0.468247f, 0.0682931f},
       {3.20268e-06f, 1.53385e-06f, 2.03646e-07f},
       2.51616e-06f},
      {0.2f,
       0.5f,
       2.0f,
       {-0.362165f, -0.400583f, 0.841647f},
       {0.118135f, 0.206474f, -0.971294f},
       {0.167851f, 0.127087f, 0.0574624f},
       0.187417f},
      {0.2f,
       0.5f,
       2.0f,
       {0.272751f, -0.738652f, 0.616442f},
       {-0.635014f, 0.764867f, 0.108326f},
       {0.00218953f, 0.00199593f, 0.00184236f},
       0.00279768f},
      {0.2f,
       0.5f,
       2.0f,
       {0.710325f, 0.542957f, 0.447925f},
       {-0.566485f, -0.524569f, -0.635549f},
       {0.0404438f, 0.0304281f, 0.0147151f},
       0.0450942f},
      {0.6f,
       0.25f,
       -3.0f,
       {0.488211f, -0.197584f, 0.850065f},
       {0.493613f, -0.108832f, -0.862845f},
       {0.048329f, 0.0360418f, 0.0156177f},
       0.0542469f},
      {0.6f,
       0.25f,
       -3.0f,
       {0.0348014f, 0.736651f, 0.675377f},
       {-0.332952f, -0.48944f, -0.805972f},
       {0.0813362f, 0.0635102f, 0.0313763f},
       0.0895747f},
      {0.6f,
       0.25f,
       -3.0f,
       {0.618298f, -0.226125f, 0.752712f},
       {-0.942566f, 0.328609f, 0.0598806f},
       {0.000187501f, 7.64652e-05f, 8.00517e-06f},
       0.000140172f},
      {0.6f,
       0.25f,
       -3.0f,
       {0.0143442f, -0.54381f, 0.839085f},
       {0.848164f, 0.529488f, -0.0161504f},
       {0.000127073f, 5.81158e-05f, 7.40722e-06f},
       9.72791e-05f},
  };
  for (const Value& v : values) {
    const auto color = [&](float absorption) {
      return std::exp(-std::sqrt(absorption) * fibre_color_divisor(v.about));
    };
    Look look{"", v.along, v.about, {color(0.06f), color(0.2f), color(0.6f)}, v.tilt};
    const BsdfEval<float> e = hair(look).eval(v.wo, v.wi);
    EXPECT_NEAR(e.pdf, v.pdf, 3e-3f * v.pdf);
    EXPECT_NEAR(e.f_cos.x, v.f_cos.x, 3e-3f * v.f_cos.x);
    EXPECT_NEAR(e.f_cos.y, v.f_cos.y, 3e-3f * v.f_cos.y);
    EXPECT_NEAR(e.f_cos.z, v.f_cos.z, 3e-3f * v.f_cos.z);
  }
}

/// Number of inputs (fibre, view and random numbers) and of results of a test evaluation with
/// floats or packets.
constexpr size_t kGiven = 19, kFound = 12;

template <typename F>
std::array<F, kFound> found(const std::array<F, kGiven>& g) {
  SpecificShadingParams<F> p{};
  p.base_color = {g[0], g[1], g[2]};
  p.roughness = g[3];
  p.ior = F(1.f) + g[4];
  p.own = {g[5], F(10.f) * g[6], F(10.f) * g[7], fma(g[8], F(180.f), F(-90.f)), g[9], g[10], g[11]};
  const HairBsdf<F> bsdf(p, false);
  const auto way = [](const F& sine, const F& turn) {
    const F x = fma(sine, F(2.f), F(-1.f)), across = safe_sqrt(fma(F(-x), x, F(1.f)));
    const SinCos<F> a = sincos_2pi(turn);
    return Vec3<F>(x, F(across * a.sin), F(across * a.cos));
  };
  const Vec3<F> wo = way(g[12], g[13]);
  const BsdfEval<F> e = bsdf.eval(wo, way(g[14], g[15]));
  const BsdfSample<F> s = bsdf.sample(wo, g[16], g[17], g[18]);
  return {e.f_cos.x, e.f_cos.y,  e.f_cos.z, e.pdf, s.wi.x,     s.wi.y,
          s.wi.z,    s.weight.x, s.pdf,     s.eta, s.weight.y, s.weight.z};
}

template <size_t W>
void expect_packets_equal_scalars() {
  using F = FloatP<W>;
  Random random(W);
  for (int round = 0; round < 400; ++round) {
    std::array<std::array<float, kGiven>, W> lanes;
    for (auto& lane : lanes)
      for (float& x : lane) x = random();
    std::array<F, kGiven> given;
    for (size_t k = 0; k < kGiven; ++k) {
      float row[W];
      for (size_t i = 0; i < W; ++i) row[i] = lanes[i][k];
      given[k] = wavecomb::load<F>(row);
    }
    const std::array<F, kFound> wide = found<F>(given);
    for (size_t k = 0; k < kFound; ++k) {
      float row[W];
      wavecomb::store(row, wide[k]);
      for (size_t i = 0; i < W; ++i)
        ASSERT_EQ(std::bit_cast<uint32_t>(found<float>(lanes[i])[k]),
                  std::bit_cast<uint32_t>(row[i]))
            << W << " value " << k;
    }
  }
}

TEST(Fibre, PacketsEqualScalarsBitForBit) {
  expect_packets_equal_scalars<4>();
  expect_packets_equal_scalars<8>();
  expect_packets_equal_scalars<16>();
}

TEST(Fibre, TiltsMoveTheHighlightTowardsTheRoot) {
  Look look{"tilted", 0.05f, 0.3f, {0.01f, 0.01f, 0.01f}, 5};
  const auto peak = [&](float tilt) {
    look.tilt = tilt;
    const Hair bsdf = hair(look);
    double best = 0, at = 0;
    for (double x = -0.5; x < 0.5; x += 0.001) {
      const float f = bsdf.eval(seen_at(0, 0), wi_at({0, x, 0})).f_cos.y;
      if (static_cast<double>(f) > best) best = static_cast<double>(f), at = x;
    }
    return at;
  };
  EXPECT_NEAR(peak(0), 0, 0.005);
  EXPECT_NEAR(peak(5), std::sin(10 * kPiD / 180), 0.01);
}

TEST(Fibre, NoInputGivesNonsense) {
  Random random(7);
  for (int i = 0; i < 3000; ++i) {
    const auto extreme = [&] { return random() < 0.3f ? std::floor(2 * random()) : random(); };
    const Look look{"any",
                    extreme(),
                    extreme(),
                    {extreme(), extreme(), extreme()},
                    180 * random() - 90,
                    {extreme(), extreme(), extreme()},
                    10 * extreme(),
                    10 * extreme()};
    const Hair bsdf = hair(look);
    Vec wo = direction(2 * static_cast<double>(random()) - 1, 7 * static_cast<double>(random()));
    if (i % 7 == 0) wo = {i % 2 ? 1.f : -1.f, 0, 0};
    const BsdfSample<float> s = bsdf.sample(wo, random(), random(), random());
    EXPECT_TRUE(std::isfinite(s.pdf) && s.pdf >= 0) << i;
    for (const float x : {s.weight.x, s.weight.y, s.weight.z}) {
      EXPECT_TRUE(x >= 0 && x <= 40) << i << " " << x;
    }
    EXPECT_NEAR(length(s.wi), 1, 1e-5f);
  }
}

}  // namespace
}  // namespace wavecomb
