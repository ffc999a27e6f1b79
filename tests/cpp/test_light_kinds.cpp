// SPDX-License-Identifier: Apache-2.0
/// Tests of cylinder lights, shaping and IES profiles, compared with surface integrals and with
/// values computed by hand.
#include <numbers>

#include "lane_testing.h"
#include "light_testing.h"

namespace wavecomb {
namespace {

using namespace light_testing;

/// Returns the irradiance at the point `from`, by the midpoint rule with n x n points.
double irradiance(const Lights& lights, const Vec3<float>& from, const Vec3<float>& n,
                  int grid = 600) {
  const LightView view = lights.view();
  double sum = 0;
  for (int j = 0; j < grid; ++j)
    for (int i = 0; i < grid; ++i) {
      const float u = (static_cast<float>(i) + 0.5f) / static_cast<float>(grid),
                  v = (static_cast<float>(j) + 0.5f) / static_cast<float>(grid);
      const auto s = sample_light<float>(view, from, 0.5f, u, v, true);
      if (s.valid)
        sum += static_cast<double>(s.weight.y) * std::max(0.0, static_cast<double>(dot(s.wi, n)));
    }
  return sum / grid / grid;
}

/// Irradiance from a cylinder of radiance 3 along x at the origin, summed over its surface.
double cylinder_irradiance(double length, double radius, const Vec3<float>& from,
                           const Vec3<float>& n) {
  constexpr int kN = 1000;
  double sum = 0;
  for (int j = 0; j < kN; ++j)
    for (int i = 0; i < kN; ++i) {
      const double x = ((i + 0.5) / kN - 0.5) * length, phi = 2 * kPiD * (j + 0.5) / kN;
      const double m[3] = {0, std::cos(phi), std::sin(phi)};
      const double d[3] = {x - static_cast<double>(from.x),
                           radius * m[1] - static_cast<double>(from.y),
                           radius * m[2] - static_cast<double>(from.z)};
      const double d2 = d[0] * d[0] + d[1] * d[1] + d[2] * d[2];
      const double out = -(d[1] * m[1] + d[2] * m[2]);
      const double in = d[0] * static_cast<double>(n.x) + d[1] * static_cast<double>(n.y) +
                        d[2] * static_cast<double>(n.z);
      if (out > 0 && in > 0) sum += out * in / (d2 * d2);
    }
  return 3 * sum * length * radius * 2 * kPiD / kN / kN;
}

/// A light kind that lacks members does not compile (light/kinds/kinds.h).
struct KindWithoutEmission : FlatKind {
  static LightKindInfo describe();
  template <typename F>
  static detail::KindSample<F> sample(const detail::LightQuery<F>& q);
  template <typename F>
  static detail::KindHit<F> hit(const detail::LightHitQuery<F>& m);
};
struct KindWithEmission : KindWithoutEmission {
  template <typename F>
  static detail::KindEmission<F> emit(const detail::EmissionQuery<F>& q);
  template <typename F>
  static F emission_density(const detail::LightHitQuery<F>& m);
};
static_assert(!LightKindClass<KindWithoutEmission> && LightKindClass<KindWithEmission>);

TEST(LightKinds, VisitCallsTheClassOfTheKind) {
  const auto is_infinite = [](LightKind kind) {
    return visit(kind, []<typename Kind>(Kind) { return Kind::kIsInfinite; });
  };
  for (uint32_t k = 0; k < kLightKindCount; ++k) {
    const auto kind = static_cast<LightKind>(k);
    EXPECT_EQ(is_infinite(kind), info_of(kind).has(light_trait::kInfinite)) << k;
  }
}

TEST(Cylinder, IrradianceIsTheSumOverItsSurface) {
  struct Case {
    float length, radius;
    Vec3<float> from, n;
  };
  for (const Case& c :
       {Case{2, 0.5f, {0, 0, -2}, {0, 0, 1}}, Case{2, 0.5f, {0.4f, 0, -0.6f}, {0, 0, 1}},  // close
        Case{1, 0.5f, {3, 0.7f, -1}, {-0.8f, 0, 0.6f}},  // from its end
        Case{0.5f, 2, {0.2f, 5, 1}, {0, -1, 0}}, Case{40, 0.01f, {1, 0, -1}, {0, 0, 1}},
        Case{0.1f, 0.05f, {30, 0, -40}, {-0.6f, 0, 0.8f}}}) {  // far
    Light light = make_light(LightKind::kCylinder);
    light.length = c.length;
    light.radius = c.radius;
    const double exact = cylinder_irradiance(static_cast<double>(c.length),
                                             static_cast<double>(c.radius), c.from, c.n);
    EXPECT_NEAR(irradiance(Lights({light}), c.from, c.n) / exact, 1, 1e-3)
        << c.length << ", " << c.radius;
  }
}

TEST(Cylinder, PlacesAlongALineOfItAreNotRounded) {
  // The receiver is 0.01 above the extension of a line of the cylinder, two lengths away. All sines
  // of the inclination then differ from 1 by only about 1e-6. A naive formula rounds sample
  // positions to steps of 0.05 and places some of them 0.03 outside the light.
  Light light = make_light(LightKind::kCylinder);
  light.length = 2;
  const Lights lights({light});
  for (const float side : {1.f, -1.f}) {
    const Vec3<float> from{5 * side, 0.51f, 0};
    const auto slope = [&](double x) {
      const double z = x - static_cast<double>(from.x), s = static_cast<double>(from.y) - 0.5;
      return z / std::hypot(z, s);
    };
    for (int i = 0; i < 100; ++i) {
      const double v = (i + 0.5) / 100;
      const auto s =
          sample_light<float>(lights.view(), from, 0.5f, 0.5f, static_cast<float>(v), true);
      ASSERT_TRUE(s.valid);
      double begin = -1, end = 1;
      for (int step = 0; step < 60; ++step) {
        const double middle = 0.5 * (begin + end);
        (slope(middle) < slope(-1) + v * (slope(1) - slope(-1)) ? begin : end) = middle;
      }
      EXPECT_NEAR(from.x + s.wi.x * s.distance, begin, 2e-3) << v;
      EXPECT_NEAR(from.y + s.wi.y * s.distance, 0.5, 1e-5) << v;
    }
  }
}

TEST(Cylinder, NothingLeavesItsInside) {
  const Lights lights({make_light(LightKind::kCylinder)});
  const LightView view = lights.view();
  EXPECT_FALSE(sample_light<float>(view, Vec3<float>(0.1f, 0, 0.2f), 0.5f, 0.5f, 0.5f, true).valid);
  // The ray enters through an open end of the cylinder and hits the inner wall behind the axis.
  const Vec3<float> from{-2, 0, 0.1f}, dir{0.98058068f, 0, 0.19611614f};
  const auto t = trace(view, from, dir);
  ASSERT_TRUE(t);
  const auto hit = light_hit<float>(view, 0u, from, dir, *t, true);
  EXPECT_EQ(hit.radiance.y, 0);
  EXPECT_EQ(hit.pdf, 0);
}

TEST(Cylinder, NormalizeKeepsItsPower) {
  for (const float size : {0.1f, 1.f, 7.f}) {
    Light light = make_light(LightKind::kCylinder, scale(size, 2 * size, 2 * size));
    light.normalize = true;
    const Lights lights({light});
    const double area = 2 * kPiD * static_cast<double>(size) * static_cast<double>(size);
    EXPECT_NEAR(static_cast<double>(lights.set.records[0].radiance[1]) * area, 3, 1e-5);
    EXPECT_NEAR(static_cast<double>(lights.set.records[0].area) / area, 1, 1e-6);
  }
}

/// Returns the radiant intensity in direction `dir` of a point light with shaping at the origin.
/// Without shaping, the intensity would be 3 in green and 2 in red.
Color<float> sent(const Shaping& shaping, Vec3<float> dir, const Affine& turned = {},
                  std::vector<IesProfile> profiles = {}) {
  Light light = make_light(LightKind::kSphere, turned);
  light.radius = 0;
  light.shaping = shaping;
  Lights lights;
  lights.profiles = std::move(profiles);
  lights.build({light});
  dir = normalize(dir);
  const auto s = sample_light<float>(lights.view(), dir, 0.5f, 0.5f, 0.5f, true);
  return s.valid ? s.weight : Color<float>(0.f);
}

Vec3<float> off_axis(double degrees, double around = 0) {
  const double t = degrees * kPiD / 180, p = around * kPiD / 180;
  // The azimuth phi of a profile refers to the direction towards the light (docs/lights.md).
  return {static_cast<float>(-std::sin(t) * std::cos(p)),
          static_cast<float>(-std::sin(t) * std::sin(p)), static_cast<float>(-std::cos(t))};
}

TEST(Shaping, FocusIsAPowerOfTheCosineAndTintsTheRest) {
  const Shaping shaping{2.5f, {0.25f, 0, 0}};
  for (const double angle : {0.0, 30.0, 60.0, 85.0, 120.0, 180.0}) {
    const double f = std::pow(std::fabs(std::cos(angle * kPiD / 180)), 2.5);
    const Color<float> c = sent(shaping, off_axis(angle));
    EXPECT_NEAR(c.y, 3 * f, 1e-4) << angle;
    EXPECT_NEAR(c.x, 2 * (0.25 + 0.75 * f), 1e-4) << angle;
  }
  EXPECT_NEAR(sent({2.5f, {1, 1, 1}}, off_axis(70)).y, 3, 1e-4);  // white: no focus
}

TEST(Shaping, ConeIsHardOrSmooth) {
  const Shaping hard{0, {}, 40, 0}, soft{0, {}, 40, 0.5f}, all_soft{0, {}, 90, 1};
  EXPECT_FLOAT_EQ(sent(hard, off_axis(39.99)).y, 3);
  EXPECT_EQ(sent(hard, off_axis(40.01)).y, 0);
  EXPECT_FLOAT_EQ(sent(soft, off_axis(19.9)).y, 3);
  EXPECT_EQ(sent(soft, off_axis(40.1)).y, 0);
  for (const double angle : {20.5, 25.0, 30.0, 35.0, 39.0}) {
    const double x = (angle - 20) / 20;
    EXPECT_NEAR(sent(soft, off_axis(angle)).y, 3 * (1 - x * x * (3 - 2 * x)), 3e-4) << angle;
  }
  EXPECT_NEAR(sent(all_soft, off_axis(45)).y, 1.5, 1e-4);
  EXPECT_FLOAT_EQ(sent({0, {}, 180, 0.3f}, off_axis(179)).y, 3);  // 180: no cone
  // The light's axis is the transformed -z, and scale does not affect it.
  EXPECT_FLOAT_EQ(sent(hard, {1, 0, 0}, rotate(0, -90) * scale(3, 2, 5)).y, 3);
  EXPECT_EQ(sent(hard, {-1, 0, 0}, rotate(0, -90) * scale(3, 2, 5)).y, 0);
}

/// IES profile with two planes of 3 angles. The intensity is 8 candela on the axis and decreases
/// outwards.
IesProfile lamp() {
  return {{0, 30, 90}, {0, 90, 360}, {8, 6, 0, 8, 2, 1, 8, 6, 0}};
}

TEST(Ies, BilinearBetweenItsAngles) {
  const Shaping shaping{0, {}, 180, 0, 0};
  const auto candela = [&](double theta, double phi, const Shaping& s) {
    return static_cast<double>(sent(s, off_axis(theta, phi), {}, {lamp()}).y) / 3;
  };
  EXPECT_NEAR(candela(0, 0, shaping), 8, 1e-4);
  EXPECT_NEAR(candela(15, 0, shaping), 7, 7e-4);
  EXPECT_NEAR(candela(15, 90, shaping), 5, 5e-4);
  EXPECT_NEAR(candela(15, 45, shaping), 6, 6e-4);
  EXPECT_NEAR(candela(60, 90, shaping), 1.5, 1e-3);
  EXPECT_NEAR(candela(60, 225, shaping), 2.25, 2e-3);
  EXPECT_EQ(candela(91, 0, shaping), 0);  // outside
  Shaping wide = shaping;
  wide.ies_angle_scale = 2;  // theta / 2
  EXPECT_NEAR(candela(30, 0, wide), 7, 7e-4);
  EXPECT_NEAR(candela(120, 90, wide), 1.5, 2e-3);
  Shaping from_above = shaping;
  from_above.ies_angle_scale = -1.5f;  // (theta - 180) / 1.5 + 180
  EXPECT_EQ(candela(60, 0, from_above), 0);
  EXPECT_NEAR(candela(30, 90, from_above), 2 - 50 / 60.0, 1e-3);
}

TEST(Ies, ScaledBeyondItsEnds) {
  // As in OpenUSD's reference implementation, scaled angles beyond 180 degrees have the last value
  // of the profile, and scaled angles below 0 have intensity 0.
  const auto candela = [&](double theta, float angle_scale, const IesProfile& profile) {
    Shaping shaping{0, {}, 180, 0, 0};
    shaping.ies_angle_scale = angle_scale;
    return static_cast<double>(sent(shaping, off_axis(theta), {}, {profile}).y) / 3;
  };
  const IesProfile all_around{{0, 90, 180}, {0}, {1, 2, 4}};
  EXPECT_NEAR(candela(22.5, 0.5f, all_around), 1.5, 1e-3);
  EXPECT_NEAR(candela(67.5, 0.5f, all_around), 3, 1e-3);
  for (const double theta : {90.5, 120.0, 150.0, 179.5}) {
    EXPECT_NEAR(candela(theta, 0.5f, all_around), 4, 1e-5) << theta;
    EXPECT_NEAR(candela(theta, 0.25f, all_around), 4, 1e-5) << theta;
  }
  EXPECT_NEAR(candela(135, -0.5f, all_around), 2, 1e-3);  // 2 theta - 180
  for (const double theta : {1.0, 45.0, 89.0})
    EXPECT_EQ(candela(theta, -0.5f, all_around), 0) << theta;
  // The intensity is 0 outside the angle range of the profile.
  const IesProfile downwards{{0, 90}, {0}, {1, 2}};
  EXPECT_NEAR(candela(22.5, 0.5f, downwards), 1.5, 1e-3);
  for (const double theta : {46.0, 91.0, 120.0, 179.0})
    EXPECT_EQ(candela(theta, 0.5f, downwards), 0) << theta;
}

TEST(Ies, MeanIsExactAndNormalizes) {
  // A profile that falls linearly from 1 at theta = 0 to 0 at theta = pi has the spherical mean 1/2
  // integral sin theta (1 - theta / pi) = 1 / 2.
  EXPECT_NEAR((IesProfile{{0, 180}, {0}, {1, 0}}).mean(), 0.5, 1e-12);
  // For a profile that falls linearly from 1 to 0 over a hemisphere, the mean over the hemisphere
  // is the integral of sin theta (1 - 2 theta / pi), which is 1 - 2 / pi.
  EXPECT_NEAR((IesProfile{{0, 90}, {0}, {1, 0}}).mean(), 1 - 2 / kPiD, 1e-12);
  EXPECT_NEAR((IesProfile{{0, 90, 180}, {0, 360}, {5, 5, 5, 5, 5, 5}}).mean(), 5, 1e-6);
  Shaping shaping{0, {}, 180, 0, 0};
  shaping.ies_normalize = true;
  EXPECT_NEAR(sent(shaping, off_axis(0), {}, {lamp()}).y, 3 * 8 / lamp().mean(), 1e-3);

  // With ies_normalize, the shaped and the unshaped light have equal power, up to a factor for
  // profiles that cover a hemisphere.
  Light light = make_light(LightKind::kSphere);
  light.radius = 0;
  light.shaping = shaping;
  Lights lights;
  lights.profiles = {lamp()};
  lights.build({light});
  double sum = 0;
  constexpr int kN = 500;
  for (int j = 0; j < kN; ++j)
    for (int i = 0; i < kN; ++i) {
      const double z = 2 * (j + 0.5) / kN - 1, phi = 2 * kPiD * (i + 0.5) / kN,
                   r = std::sqrt(1 - z * z);
      const Vec3<float> p(static_cast<float>(r * std::cos(phi)),
                          static_cast<float>(r * std::sin(phi)), static_cast<float>(z));
      const auto s = sample_light<float>(lights.view(), p, 0.5f, 0.5f, 0.5f, true);
      if (s.valid) sum += static_cast<double>(s.weight.y) / kN / kN;
    }
  EXPECT_NEAR(sum / (3 * 0.5), 1, 1e-3);
}

TEST(Shaping, BothTechniquesSeeTheSame) {
  for (const LightKind kind :
       {LightKind::kRect, LightKind::kDisk, LightKind::kSphere, LightKind::kCylinder}) {
    Light light = make_light(kind, translate(0.2f, 0.1f, 2) * rotate(20, 10));
    light.shaping = {1.2f, {0.5f, 0, 0}, 50, 0.7f, 0, 1.5f};
    Lights lights;
    lights.profiles = {lamp()};
    lights.build({light});
    const LightView view = lights.view();
    int seen = 0;
    std::mt19937 rng(4);
    const auto number = [&rng] { return static_cast<float>(rng() >> 8) * 0x1p-24f; };
    for (int i = 0; i < 2000; ++i) {
      const auto s =
          sample_light<float>(view, Vec3<float>(0, 0, 0), number(), number(), number(), true);
      if (!s.valid) continue;
      const auto t = trace(view, {0, 0, 0}, s.wi);
      if (!t) continue;
      const auto hit = light_hit<float>(view, 0u, Vec3<float>(0, 0, 0), s.wi, *t, true);
      if (hit.pdf == 0) continue;
      EXPECT_NEAR(hit.radiance.x, s.weight.x * s.pdf, 2e-3 * hit.radiance.x + 1e-4);
      ++seen;
    }
    EXPECT_GT(seen, 1000) << static_cast<int>(kind);
  }
}

}  // namespace
}  // namespace wavecomb
