// SPDX-License-Identifier: Apache-2.0
/// Tests of lights: both sampling techniques of MIS, closed forms of irradiance, textured lights,
/// and packets. test_light_samples.cpp contains the chi-square tests.
#include "wavecomb/light/sampling/light_sample.h"

#include <functional>

#include "bsdf_testing.h"
#include "lane_testing.h"
#include "light_testing.h"

namespace wavecomb {
namespace {

using namespace light_testing;
using lane_testing::kInf;
using lane_testing::kNan;

/// Returns the light density that MIS uses for the ray from `from` along `dir`, for a set with one
/// light.
float density(const Lights& lights, const Vec3<float>& from, const Vec3<float>& dir) {
  const LightView view = lights.view();
  if (view.first_triangle == 0) {
    const auto t = trace(view, from, dir);
    return t ? triangle_light_pdf<float>(view, 0u, from, dir, *t, true) : 0.f;
  }
  const LightRecord& r = view.lights[0];
  switch (static_cast<LightKind>(r.kind)) {
    case LightKind::kDistant:
      return detail::hit_distant<float>(detail::LightReader<float>(r, true), dir).pdf *
             r.selection_pdf;
    case LightKind::kDome:
      return detail::hit_dome_from<float>(view, r, from, dir, true).pdf * r.selection_pdf;
    default: {
      const auto t = trace(view, from, dir);
      return t ? light_hit<float>(view, 0u, from, dir, *t, true).pdf : 0.f;
    }
  }
}

struct Case {
  std::string name;
  Lights lights;
  Vec3<float> from{0, 0, 0};
};

/// Tests one case per sampling method, seen from the origin.
std::vector<Case> sampling_cases() {
  std::vector<Case> cases;
  const auto add = [&](const char* name, const Light& light) {
    cases.push_back({name, Lights({light}), {0, 0, 0}});
  };
  Light rect =
      make_light(LightKind::kRect, rotate(25, 15) * translate(0.3f, -0.2f, 1.f) * scale(2, 3, 1));
  add("rect", rect);
  const Affine shear{{{1, 0.6f, 0}, {0, 1, 0}, {0, 0, 1}}, {0.5f, 0, 1}};
  add("sheared rect", make_light(LightKind::kRect, shear * scale(2, 2, 2)));
  add("disk", make_light(LightKind::kDisk,
                         rotate(-40, 60) * translate(0.1f, 0.2f, 0.8f) * scale(3, 1.5f, 1)));
  Light sphere = make_light(LightKind::kSphere, translate(0.3f, 0.6f, -0.5f));
  add("sphere", sphere);
  sphere.radius = 0.83f;
  add("sphere, close", sphere);
  Light tube = make_light(LightKind::kCylinder, rotate(30, 70) * translate(0.4f, 0.9f, -0.3f));
  tube.length = 2;
  add("cylinder", tube);
  tube.radius = 0.8f;
  add("cylinder, close", tube);
  Light distant = make_light(LightKind::kDistant, rotate(40, 110));
  distant.angle = 60;
  add("distant", distant);
  distant.angle = 250;
  add("distant, wide", distant);
  add("dome", make_light(LightKind::kDome));
  const std::vector<Affine> portals = {translate(0.2f, 0.1f, 1) * scale(1.5f, 2, 1),
                                       rotate(20, 90) * translate(0, 0, 0.9f) * scale(1, 2, 1)};
  Light lit_room = make_light(LightKind::kDome);
  lit_room.portals = portals;
  add("dome with portals", lit_room);
  for (const auto& [width, has_portals] : {std::pair(16u, false), {5u, false}, {16u, true}}) {
    Case c;
    c.name = "dome with an image " + std::to_string(width) + " wide";
    if (has_portals) c.name += " and portals";
    std::mt19937 rng(9);
    std::vector<float> rgb(size_t{width} * 8 * 3);
    for (size_t i = 0; i < rgb.size(); ++i)
      rgb[i] = i / 3 % 5 == 0 ? 8.f : static_cast<float>(rng() % 100) / 100.f;
    Light dome = make_light(LightKind::kDome, rotate(0, 35));
    dome.texture = c.lights.add_texture(width, 8, rgb, width == 5 ? Wrap::kRepeat : Wrap::kClamp);
    if (has_portals) dome.portals = portals;
    c.lights.build({dome});
    cases.push_back(std::move(c));
  }
  Case triangle{
      "triangle",
      Lights({}, {make_triangle({-1, -0.5f, 0.7f}, {1.2f, 0.3f, 0.6f}, {-0.2f, 1.5f, -0.9f})}),
      {0, 0, 0}};
  cases.push_back(std::move(triangle));
  return cases;
}

TEST(LightSampling, HitDensityIsTheSamplingDensity) {
  auto cases = sampling_cases();
  std::mt19937 rng(5);
  const auto number = [&rng] { return static_cast<float>(rng() >> 8) * 0x1p-24f; };
  for (Case& c : cases) {
    const LightView view = c.lights.view();
    const bool is_triangle = view.first_triangle == 0;
    const bool is_dome_image = !is_triangle && view.lights[0].texture != kNoTexture;
    int outside = 0;
    for (int i = 0; i < 20000; ++i) {
      const auto s = sample_light<float>(view, c.from, number(), number(), number(), true);
      ASSERT_TRUE(s.valid) << c.name;
      ASSERT_NEAR(dot(s.wi, s.wi), 1, 1e-5);
      const float pdf = density(c.lights, c.from, s.wi);
      // Rounding may move a direction across an edge of the light or of a cell of the dome's image.
      if (std::fabs(pdf / s.pdf - 1) > 1e-3) {
        ++outside;
        continue;
      }
      // The weight of a light sample times its pdf is the radiance of the light, which is 3 here
      // and equals the radiance of a hit.
      if (!is_dome_image) {
        ASSERT_NEAR(s.weight.y * s.pdf, 3, 1e-5);
      }
      const Color<float> escaped =
          escaped_radiance<float>(view, {.from = c.from, .dir = s.wi, .is_delta = true}, true);
      if (view.infinite_count) {
        ASSERT_NEAR(escaped.y, s.weight.y * s.pdf, 1e-3 * escaped.y + 1e-5) << c.name;
      }
      if (const auto t = view.infinite_count ? std::nullopt : trace(view, c.from, s.wi)) {
        ASSERT_NEAR(*t, s.distance, 1e-3 * *t) << c.name;
        const UInt<float> light = 0;
        if (!is_triangle) {
          ASSERT_NEAR(light_hit<float>(view, light, c.from, s.wi, *t, true).radiance.y, 3, 1e-5)
              << c.name;
        }
      }
    }
    EXPECT_LT(outside, is_dome_image ? 60 : 10) << c.name;
  }
}

TEST(LightSampling, BothHalvesOfMisSumTo1) {
  auto cases = sampling_cases();
  std::mt19937 rng(6);
  const auto number = [&rng] { return static_cast<float>(rng() >> 8) * 0x1p-24f; };
  for (const Case& c : cases) {
    const LightView view = c.lights.view();
    int bad = 0;
    for (int i = 0; i < 5000; ++i) {
      const auto s = sample_light<float>(view, c.from, number(), number(), number(), true);
      const float bsdf_pdf = std::exp(number() * 10 - 5);
      const float light_half = balance_weight<float>(s.pdf, bsdf_pdf);
      float bsdf_half = 0;
      if (view.infinite_count) {
        EscapedRay<float> ray{.from = c.from, .dir = s.wi, .bsdf_pdf = bsdf_pdf};
        const float weighted = escaped_radiance<float>(view, ray, true).y;
        ray.is_delta = true;
        bsdf_half = weighted / escaped_radiance<float>(view, ray, true).y;
      } else {
        bsdf_half = balance_weight<float>(bsdf_pdf, density(c.lights, c.from, s.wi));
      }
      bad += !(std::fabs(light_half + bsdf_half - 1) < 1e-3f);
    }
    EXPECT_LT(bad, 20) << c.name;  // directions on edges
  }
  EXPECT_EQ(balance_weight(0.f, 0.f), 0.f);
  EXPECT_EQ(balance_weight(1.f, 0.f), 1.f);
  EXPECT_EQ(balance_weight(kInf, 1.f), 1.f);
  EXPECT_EQ(balance_weight(1.f, kInf), 0.f);
}

/// Returns the irradiance at the point `from` of a surface with the given normal, by jittered
/// samples.
double irradiance(const Lights& lights, const Vec3<float>& from, const Vec3<float>& n,
                  int grid = 700) {
  const LightView view = lights.view();
  std::mt19937 rng(8);
  const auto number = [&rng] { return static_cast<double>(rng() >> 8) * 0x1p-24; };
  double sum = 0;
  for (int j = 0; j < grid; ++j)
    for (int i = 0; i < grid; ++i) {
      const auto u = std::min(static_cast<float>((i + number()) / grid), kOneMinusEpsilon);
      const auto v = std::min(static_cast<float>((j + number()) / grid), kOneMinusEpsilon);
      const auto pick = static_cast<float>(rng() >> 8) * 0x1p-24f;
      const auto s = sample_light<float>(view, from, pick, u, v, true);
      if (s.valid)
        sum += static_cast<double>(s.weight.y) * std::max(0.0, static_cast<double>(dot(s.wi, n)));
    }
  return sum / grid / grid;
}

const Vec3<float> kUp{0, 0, 1}, kOrigin{0, 0, 0};

TEST(Irradiance, RectAboveAPoint) {
  // A rect with a corner above the point: E = L / 2 (a / A atan(b / A) + b / B atan(a / B)), A =
  // sqrt(1 + a^2), B = sqrt(1 + b^2), with sides a and b in units of the height.
  for (const float size : {0.1f, 1.f, 10.f}) {
    Light light = make_light(LightKind::kRect, translate(0, 0, 2) * scale(2 * size, 4 * size, 1));
    const double a = size / 2, b = 2 * size / 2, big_a = std::sqrt(1 + a * a),
                 big_b = std::sqrt(1 + b * b);
    const double corner =
        3 / 2.0 * (a / big_a * std::atan(b / big_a) + b / big_b * std::atan(a / big_b));
    EXPECT_NEAR(irradiance(Lights({light}), kOrigin, kUp) / (4 * corner), 1, 2e-3) << size;
    EXPECT_EQ(irradiance(Lights({light}), {0, 0, 5}, -kUp, 10), 0);
  }
}

TEST(Irradiance, DiskAboveAPoint) {
  for (const float radius : {0.01f, 1.f, 20.f}) {
    Light light = make_light(LightKind::kDisk, translate(0, 0, 3));
    light.radius = radius;
    const double r2 = static_cast<double>(radius) * radius;
    EXPECT_NEAR(irradiance(Lights({light}), kOrigin, kUp) / (kPiD * 3 * r2 / (r2 + 9)), 1, 2e-3)
        << radius;
  }
}

TEST(Irradiance, SphereNearAndFar) {
  // For a sphere entirely above the horizon, E = pi L (r / d)^2 cos theta.
  for (const double distance : {1.001, 2.0, 100.0, 1e5}) {
    for (const double tilt : {0.0, 0.4}) {
      const double cosine = std::cos(tilt);
      if (1 / distance > cosine) continue;
      Light light =
          make_light(LightKind::kSphere, translate(static_cast<float>(distance * std::sin(tilt)), 0,
                                                   static_cast<float>(distance * cosine)));
      light.radius = 1;
      if (distance < 1.1 && tilt > 0) continue;
      const double exact = kPiD * 3 / distance / distance * cosine;
      EXPECT_NEAR(irradiance(Lights({light}), kOrigin, kUp, 300) / exact, 1, 2e-3)
          << distance << ", " << tilt;
    }
  }
}

TEST(Irradiance, PointLight) {
  Light light = make_light(LightKind::kSphere, translate(0, 3, 4));
  light.radius = 0;
  const Lights lights({light});
  EXPECT_NEAR(irradiance(lights, kOrigin, kUp, 1), 3 / 25.0 * 0.8, 1e-6);
  const auto s = sample_light<float>(lights.view(), kOrigin, 0.3f, 0.2f, 0.1f, true);
  EXPECT_TRUE(s.is_delta);
  EXPECT_EQ(s.pdf, 1);
  EXPECT_FLOAT_EQ(s.distance, 5);
  EXPECT_FALSE(
      sample_light<float>(lights.view(), Vec3<float>{0, 3, 4}, 0.3f, 0.2f, 0.1f, true).valid);
}

TEST(Irradiance, DistantLights) {
  for (const float angle : {0.f, 0.01f, 0.53f, 30.f, 180.f}) {
    Light light = make_light(LightKind::kDistant);  // emits along -z
    light.angle = angle;
    light.normalize = true;
    EXPECT_NEAR(irradiance(Lights({light}), kOrigin, kUp, 300), 3, 3e-3) << angle;
    light.normalize = false;
    const double s = std::sin(angle / 2 * kPiD / 180);
    if (angle > 0) {
      EXPECT_NEAR(irradiance(Lights({light}), kOrigin, kUp, 300) / (3 * kPiD * s * s), 1, 1e-3)
          << angle;
    }
  }
}

TEST(Irradiance, Domes) {
  EXPECT_NEAR(irradiance(Lights({make_light(LightKind::kDome)}), kOrigin, kUp), 3 * kPiD, 0.01);
  Lights constant;
  Light dome = make_light(LightKind::kDome);
  dome.texture = constant.add_texture(3, 5, std::vector<float>(45, 0.5f));
  constant.build({dome});
  EXPECT_NEAR(irradiance(constant, kOrigin, kUp), 1.5 * kPiD, 0.01);

  // The dome image contains a sun. The reference value is an integral of radiance over the sphere.
  std::mt19937 rng(77);
  std::vector<float> rgb(32 * 16 * 3);
  for (float& x : rgb) x = static_cast<float>(rng() % 100) / 100.f;
  for (size_t c = 0; c < 3; ++c) rgb[3 * (4 * 32 + 11) + c] = 500;
  Lights lights;
  dome.texture = lights.add_texture(32, 16, rgb);
  dome.to_world = rotate(70, 20);
  lights.build({dome});
  double exact = 0;
  constexpr int kN = 1000;
  for (int j = 0; j < kN; ++j)
    for (int i = 0; i < kN; ++i) {
      const double z = (j + 0.5) / kN, phi = 2 * kPiD * (i + 0.5) / kN;
      const auto radiance = escaped_radiance<float>(
          lights.view(),
          {.from = kOrigin, .dir = bsdf_testing::direction(z, phi), .is_delta = true}, true);
      exact += static_cast<double>(radiance.y) * z * 2 * kPiD / kN / kN;
    }
  EXPECT_NEAR(irradiance(lights, kOrigin, kUp) / exact, 1, 3e-3);
}

TEST(Irradiance, ManyLightsSumUp) {
  // Selection among four lights of very different power and kind.
  Light rect = make_light(LightKind::kRect, translate(0, 0, 2)),
        sphere = make_light(LightKind::kSphere, translate(3, 0, 3)),
        distant = make_light(LightKind::kDistant),
        disk = make_light(LightKind::kDisk, translate(0, 1, 1));
  distant.normalize = true;
  disk.color = {0.01f, 0.01f, 0.01f};
  const std::vector<Light> all = {rect, sphere, distant, disk};
  double sum = 0;
  for (const Light& light : all) sum += irradiance(Lights({light}), kOrigin, kUp, 300);
  EXPECT_NEAR(irradiance(Lights(all), kOrigin, kUp, 1500) / sum, 1, 5e-3);
}

TEST(Irradiance, TriangleAgreesWithRect) {
  const EmissiveTriangle a = make_triangle({-1, -1, 2}, {1, -1, 2}, {1, 1, 2}),
                         b = make_triangle({-1, -1, 2}, {1, 1, 2}, {-1, 1, 2});
  const double rect = irradiance(
      Lights({make_light(LightKind::kRect, translate(0, 0, 2) * scale(2, 2, 1))}), kOrigin, kUp);
  EXPECT_NEAR(irradiance(Lights({}, {a, b}), kOrigin, kUp) / rect, 1, 3e-3);
  EXPECT_NEAR(irradiance(Lights({}, {a, b}), {0, 0, 4}, -kUp) / rect, 1, 3e-3);  // the other side
}

TEST(TexturedLights, RectShowsItsImageUprightFromTheFront) {
  // The rect emits along -z and is seen from z < 0, with +y up.
  Lights lights;
  Light light = make_light(LightKind::kRect);
  light.color = {1, 1, 1};
  light.texture = lights.add_texture(2, 2, {1, 0, 0, 0, 1, 0, 0, 0, 1, 1, 1, 1});
  lights.build({light});
  const auto seen = [&](float x, float y) {
    return light_hit<float>(lights.view(), 0u, Vec3<float>{x, y, -1}, {0, 0, 1}, 1.f, true)
        .radiance;
  };
  // For a viewer that looks along +z with +y up, right is -x.
  EXPECT_NEAR(seen(0.25f, 0.25f).x, 1, 1e-5);  // upper left: red
  EXPECT_NEAR(seen(0.25f, 0.25f).y, 0, 1e-5);
  EXPECT_NEAR(seen(-0.25f, 0.25f).y, 1, 1e-5);  // upper right: green
  EXPECT_NEAR(seen(-0.25f, 0.25f).x, 0, 1e-5);
  EXPECT_NEAR(seen(0.25f, -0.25f).z, 1, 1e-5);  // lower left: blue
  EXPECT_NEAR(seen(0.25f, -0.25f).x, 0, 1e-5);
  EXPECT_NEAR(seen(-0.25f, -0.25f).x, 1, 1e-5);
  EXPECT_EQ(
      light_hit<float>(lights.view(), 0u, Vec3<float>{0, 0, 1}, {0, 0, -1}, 1.f, true).radiance.y,
      0);
  // Light samples have the same radiance as hits at the same position.
  std::mt19937 rng(2);
  for (int i = 0; i < 1000; ++i) {
    const auto s = sample_light<float>(lights.view(), Vec3<float>{0.1f, 0.2f, -1}, 0.f,
                                       static_cast<float>(rng() % 999) / 999.f,
                                       static_cast<float>(rng() % 999) / 999.f, true);
    const auto hit =
        light_hit<float>(lights.view(), 0u, Vec3<float>{0.1f, 0.2f, -1}, s.wi, s.distance, true);
    ASSERT_NEAR(hit.radiance.x, s.weight.x * s.pdf, 1e-4);
    ASSERT_NEAR(hit.pdf / s.pdf, 1, 1e-4);
  }
}

TEST(TexturedLights, DomeFollowsOpenExrsConvention) {
  // Four columns: the centre of the image is +z, s = 1/4 is +x, s = 3/4 is -x, the seam is -z.
  Lights lights;
  Light light = make_light(LightKind::kDome);
  light.color = {1, 1, 1};
  constexpr uint32_t kW = 64, kH = 32;
  std::vector<float> rgb(kW * kH * 3, 0.f);
  const auto paint = [&](uint32_t x, uint32_t y, size_t channel, float value) {
    for (int dx = -2; dx < 2; ++dx)
      rgb[3 * (y * kW + (x + kW + static_cast<uint32_t>(dx)) % kW) + channel] = value;
  };
  for (uint32_t y = 14; y < 18; ++y) {
    paint(16, y, 0, 1);  // s = 1/4: red
    paint(32, y, 1, 1);  // s = 1/2: green
    paint(48, y, 2, 1);  // s = 3/4: blue
  }
  for (uint32_t y = 0; y < 3; ++y)
    for (uint32_t x = 0; x < kW; ++x) rgb[3 * (y * kW + x)] = 7;
  light.texture = lights.add_texture(kW, kH, rgb);
  lights.build({light});
  const auto seen = [&](float x, float y, float z) {
    return escaped_radiance<float>(lights.view(),
                                   {.from = kOrigin, .dir = {x, y, z}, .is_delta = true}, true);
  };
  EXPECT_NEAR(seen(1, 0, 0).x, 1, 1e-5);
  EXPECT_NEAR(seen(0, 0, 1).y, 1, 1e-5);
  EXPECT_NEAR(seen(-1, 0, 0).z, 1, 1e-5);
  EXPECT_NEAR(seen(0, 0, -1).y, 0, 1e-5);
  EXPECT_NEAR(seen(0, 1, 0).x, 7, 1e-5);
  EXPECT_NEAR(seen(0, -1, 0).x, 0, 1e-5);
  // A rotation of the dome by 90 degrees about y moves the centre of the image from +z to +x.
  light.to_world = rotate(0, 90);
  lights.build({light});
  EXPECT_NEAR(seen(1, 0, 0).y, 1, 1e-5);
}

TEST(TexturedLights, TriangleReadsItsMaterialsEmission) {
  Lights lights;
  std::vector<float> rgb(8 * 8 * 3);
  std::mt19937 rng(4);
  for (float& x : rgb) x = static_cast<float>(rng() % 100) / 50.f - 0.2f;
  const uint32_t material = lights.add_material(lights.add_texture(8, 8, rgb), {2, 3, 4, 1});
  EmissiveTriangle t = make_triangle({0, 0, 1}, {1, 0, 1}, {0, 1, 1});  // uv = xy
  t.material = material;
  lights.build({}, {t});
  for (int i = 0; i < 2000; ++i) {
    const auto s = sample_light<float>(lights.view(), Vec3<float>{0.3f, 0.2f, 0}, 0.f,
                                       static_cast<float>(rng() % 999) / 999.f,
                                       static_cast<float>(rng() % 999) / 999.f, true);
    const Vec3<float> p = Vec3<float>(0.3f, 0.2f, 0) + s.wi * s.distance;
    const auto texel = lookup<float>(lights.views[0], p.x, p.y, 0.f, true);
    const Vec3<float> expected(std::max(0.f, 2 * texel.r), std::max(0.f, 3 * texel.g),
                               std::max(0.f, 4 * texel.b));
    if (!s.valid) {
      ASSERT_LT(expected.x + expected.y + expected.z, 1e-4);
      continue;
    }
    ASSERT_NEAR(s.weight.x * s.pdf, expected.x, 1e-3);
    ASSERT_NEAR(s.weight.y * s.pdf, expected.y, 1e-3);
    ASSERT_NEAR(s.weight.z * s.pdf, expected.z, 1e-3);
  }
}

/// A set with lights of all kinds, some of them textured.
Lights all_kinds() {
  Lights lights;
  std::mt19937 rng(12);
  std::vector<float> rgb(24 * 12 * 3);
  for (float& x : rgb) x = static_cast<float>(rng() % 1000) / 100.f;
  const uint32_t first = lights.add_texture(24, 12, rgb), second = lights.add_texture(12, 24, rgb);
  std::vector<Light> all;
  for (const LightKind kind : {LightKind::kRect, LightKind::kDisk, LightKind::kSphere,
                               LightKind::kCylinder, LightKind::kDistant, LightKind::kDome})
    for (int i = 0; i < 4; ++i) {
      const auto f = static_cast<float>(i);
      all.push_back(make_light(
          kind, rotate(40 * i, 70 * i) * translate(f - 1, 2 - f, 2) * scale(1 + f, 1, 2)));
      if (i > 1 && (kind == LightKind::kRect || kind == LightKind::kDome))
        all.back().texture = i == 2 ? first : second;
      if (i == 1) all.back().angle = all.back().radius = 0;
      if (i == 2) all.back().shaping = {1.5f, {0.2f, 0, 1}, 70, 0.5f};
      if (i == 3) all.back().shaping = {0, {}, 100, 0, i % 2u, -0.7f, true};
      if (i == 2) all.back().specular = 0.5f;
      if (i > 0 && kind == LightKind::kDome)
        all.back().portals = {translate(1, 0, 2) * scale(3, 2, 1), rotate(90, 10) * scale(2, 2, 1)};
      if (kind == LightKind::kDome) all.back().color = {0.001f, 0.002f, 0.003f};
    }
  std::vector<EmissiveTriangle> triangles = {make_triangle({0, 0, 3}, {2, 0, 3}, {0, 2, 3}),
                                             make_triangle({0, 0, -3}, {4, 0, -3}, {0, 4, -4}),
                                             make_triangle({1, 1, 1}, {1, 1, 1}, {1, 1, 1})};
  triangles[1].material = lights.add_material(first);
  lights.profiles = {{{0, 40, 40, 90}, {0}, {1, 3, 0, 2}},
                     {{0, 90, 180}, {0, 100, 360}, {1, 2, 3, 3, 0, 1, 1, 2, 3}}};
  lights.build(all, triangles, 1.f);
  return lights;
}

TEST(LightLanes, PacketsGiveTheBitsOfScalars) {
  const Lights lights = all_kinds();
  const LightView view = lights.view();
  constexpr size_t kN = 1 << 14;
  std::mt19937 rng(14);
  std::vector<float> in[8];
  for (auto& column : in)
    for (size_t i = 0; i < kN; ++i) column.push_back(static_cast<float>(rng() >> 8) * 0x1p-24f);
  for (size_t i = 0; i < kN; ++i)
    for (size_t c = 0; c < 3; ++c) in[c][i] = in[c][i] * 8 - 4;
  for (size_t i = 0; i < kN / 4; ++i) in[3][i] = 0.5f;
  std::vector<uint32_t> ids(kN);
  for (uint32_t i = 0; i < kN; ++i)
    ids[i] = i < kN / 4 ? i / 64 % view.count : static_cast<uint32_t>(rng()) % view.count;

  const auto run = [&]<typename F>(std::vector<float>& out) {
    out.assign(17 * kN, 0.f);
    for (size_t i = 0; i < kN; i += kWidth<F>) {
      const auto at = [&](size_t c) { return load<F>(&in[c][i]); };
      size_t column = 0;
      const auto put = [&](const F& x) { store(&out[kN * column++ + i], x); };
      const Vec3<F> p(at(0), at(1), at(2));
      const Mask<F> active = at(6) < 0.9f;
      const auto s = sample_light<F>(view, p, at(3), at(4), at(5), active);
      const F one(1.f), zero(0.f);
      for (const F& x : {s.wi.x, s.wi.y, s.wi.z, s.distance, s.weight.x, s.weight.y, s.weight.z,
                         s.pdf, select(s.is_delta, one, zero), select(s.valid, one, zero)})
        put(x);
      const UInt<F> id = load<UInt<F>>(&ids[i]);
      const Vec3<F> dir = square_to_sphere<F>(at(4), at(5));
      const auto hit = light_hit<F>(view, id, p, dir, at(7), active);
      for (const F& x : {hit.radiance.x, hit.radiance.z, hit.pdf}) put(x);
      put(triangle_light_pdf<F>(view, id, p, dir, at(7), active));
      const auto escaped = escaped_radiance<F>(
          view, {.from = Vec3<F>(F(0.f)), .dir = dir, .bsdf_pdf = at(7), .is_delta = at(6) < 0.3f},
          active);
      for (const F& x : {escaped.x, escaped.y, escaped.z}) put(x);
    }
  };
  std::vector<float> scalar;
  run.operator()<float>(scalar);
  for (const float x : scalar) ASSERT_TRUE(std::isfinite(x));
  lane_testing::for_each_packet([&]<typename F>() {
    std::vector<float> packets;
    run.template operator()<F>(packets);
    lane_testing::expect_same(scalar, packets, "lights");
  });
}

TEST(LightEdges, NoLightsAndDarkLights) {
  const Lights none(std::vector<Light>{});
  EXPECT_FALSE(sample_light<float>(none.view(), kOrigin, 0.5f, 0.5f, 0.5f, true).valid);
  const EscapedRay<float> up{.from = kOrigin, .dir = kUp, .bsdf_pdf = 1.f, .is_delta = true};
  EXPECT_EQ(escaped_radiance<float>(none.view(), up, true).x, 0);
  Light black = make_light(LightKind::kDome);
  black.color = {0, 0, 0};
  const Lights dark({black});
  for (const float pick : {0.f, 0.5f, kOneMinusEpsilon}) {
    const auto s = sample_light<float>(dark.view(), kOrigin, pick, 0.5f, 0.5f, true);
    EXPECT_FALSE(s.valid);
    EXPECT_EQ(s.pdf, 0);
    EXPECT_EQ(s.weight.x, 0);
  }
}

TEST(LightEdges, PointsOnAndInsideLightsGiveNoNan) {
  std::vector<Light> all;
  for (const LightKind kind :
       {LightKind::kRect, LightKind::kDisk, LightKind::kSphere, LightKind::kCylinder}) {
    for (const float size : {1.f, 1e-12f, 1e12f, 0.f})
      all.push_back(make_light(kind, scale(size, size, size)));
  }
  std::vector<EmissiveTriangle> triangles = {
      make_triangle({0, 0, 0}, {1, 0, 0}, {0, 1, 0}),
      make_triangle({0, 0, 0}, {1e-15f, 0, 0}, {0, 1e-15f, 0}),
      make_triangle({0, 0, 0}, {0, 0, 0}, {1, 1, 1})};
  std::mt19937 rng(3);
  for (size_t k = 0; k < all.size() + triangles.size(); ++k) {
    const Lights lights =
        k < all.size() ? Lights({all[k]}) : Lights({}, {triangles[k - all.size()]});
    const LightView view = lights.view();
    for (const Vec3<float>& p : {Vec3<float>{0, 0, 0},
                                 {0.1f, 0.1f, 0},
                                 {0, 0, 0.5f},
                                 {0, 0, -0.5f},
                                 {0, 0, 0.25f},
                                 {0, 0, 1e30f},
                                 {1e-30f, 0, -1e-30f},
                                 {0, 0, -1e-7f},
                                 {kNan, 0, 0},
                                 {kInf, 0, 0}}) {
      for (int i = 0; i < 100; ++i) {
        const float u = i == 0   ? 0.f
                        : i == 1 ? kOneMinusEpsilon
                                 : static_cast<float>(rng() >> 8) * 0x1p-24f;
        const auto s = sample_light<float>(view, p, u, u, 1 - u == 1 ? 0.f : 1 - u, true);
        for (const float x : {s.wi.x, s.wi.y, s.wi.z, s.distance, s.weight.x, s.weight.y, s.pdf})
          ASSERT_TRUE(std::isfinite(x));
        if (s.valid) {
          ASSERT_GT(s.pdf, 0);
          ASSERT_NEAR(dot(s.wi, s.wi), 1, 1e-4);
        }
        const auto hit = light_hit<float>(view, 0u, p, {0, 0, 1}, u, true);
        ASSERT_TRUE(std::isfinite(hit.radiance.x) && std::isfinite(hit.pdf) && hit.pdf >= 0);
        const float pdf = triangle_light_pdf<float>(view, 0u, p, {0, 0, 1}, u, true);
        ASSERT_TRUE(std::isfinite(pdf) && pdf >= 0);
      }
    }
  }
}

TEST(LightEdges, SphereShinesOutwardsOnly) {
  const Lights lights({make_light(LightKind::kSphere)});
  EXPECT_FALSE(
      sample_light<float>(lights.view(), Vec3<float>{0.1f, 0, 0}, 0.f, 0.5f, 0.5f, true).valid);
  const auto hit =
      light_hit<float>(lights.view(), 0u, Vec3<float>{0.1f, 0, 0}, {1, 0, 0}, 0.4f, true);
  EXPECT_EQ(hit.radiance.x, 0);
  EXPECT_EQ(hit.pdf, 0);
}

TEST(LightEdges, OtherKindsGiveNothingToLightHit) {
  const Lights lights = all_kinds();
  for (uint32_t i = 0; i < lights.set.infinite_count; ++i) {
    EXPECT_EQ(light_hit<float>(lights.view(), i, kOrigin, kUp, 1.f, true).pdf, 0);
  }
}

}  // namespace
}  // namespace wavecomb
