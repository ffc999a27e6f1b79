// SPDX-License-Identifier: Apache-2.0
/// Warps from the unit square: densities (chi-square), Jacobians, and lanes.
#include "wavecomb/core/warp.h"

#include "bsdf_testing.h"
#include "lane_testing.h"

namespace wavecomb {
namespace {

using namespace lane_testing;
using bsdf_testing::kPiD;

using chi_square::Draw;
using chi_square::Place;
using chi_square::Random;

/// A warp from the unit square to charts with a given density.
template <typename Density, typename Map>
chi_square::Case warp_case(std::string name, std::vector<chi_square::Chart> charts,
                           const Density& density, const Map& map) {
  chi_square::Case c{std::move(name), std::move(charts), density, {}};
  c.draw = [map](Random& random, bool) {
    const float u = random(), v = random();
    return Draw::at(map(u, v));
  };
  return c;
}
Place with_turn(double x, double a, double b) {
  return {0, x, std::atan2(b, a) / (2 * kPiD) + 0.5};
}

TEST(Warp, SamplesFollowTheirDensity) {
  chi_square::Battery battery("warps");
  const std::vector<chi_square::Chart> square{{0, 1, 0, 1}};
  const auto even = [](const Place&) { return 1.0; };
  // Equal areas are equal steps in r^2.
  battery.run(warp_case("disk", square, even, [](float u, float v) {
    const auto d = square_to_disk(u, v);
    const double x = d.x, y = d.y;
    return with_turn(x * x + y * y, x, y);
  }));
  battery.run(warp_case(
      "cosine hemisphere", bsdf_testing::direction_charts(),
      [](const Place& p) { return double{cosine_hemisphere_pdf(bsdf_testing::direction_at(p).z)}; },
      [](float u, float v) { return bsdf_testing::place_of(square_to_cosine_hemisphere(u, v)); }));
  battery.run(warp_case(
      "sphere", bsdf_testing::direction_charts(), [](const Place&) { return 1 / (4 * kPiD); },
      [](float u, float v) { return bsdf_testing::place_of(square_to_sphere(u, v)); }));
  for (const double one_minus_cos : {2.0, 0.5, 1e-5, 1e-9})
    battery.run(
        warp_case("cone of " + std::to_string(one_minus_cos), square, even, [=](float u, float v) {
          const auto w = square_to_cone(u, v, static_cast<float>(one_minus_cos));
          // 1 - cos from the sine, which is accurate for narrow cones: h (2 - h) = sin^2.
          const double x = w.x, y = w.y, sin2 = x * x + y * y;
          const double h = w.z > 0 ? sin2 / (1 + std::sqrt(std::max(0.0, 1 - sin2)))
                                   : 1 - static_cast<double>(w.z);
          return with_turn(h / one_minus_cos, x, y);
        }));
  // Uniform in area: P(b1 + b2 < s) = s^2, and b1 / (b1 + b2) is uniform.
  battery.run(warp_case("triangle", square, even, [](float u, float v) {
    const auto b = square_to_triangle(u, v);
    const double b1 = b.x, b2 = b.y, sum = b1 + b2;
    EXPECT_TRUE(b1 >= 0 && b2 >= 0 && sum <= 1 + 1e-6);
    return Place{0, sum * sum, b1 / std::max(sum, 1e-30)};
  }));
  battery.judge();
  EXPECT_EQ(cosine_hemisphere_pdf(-0.5f), 0.f);
  EXPECT_FLOAT_EQ(cosine_hemisphere_pdf(1.f), kInvPi);
}

/// Area of the image of a small square at (u, v), relative to the square, by its two edges.
template <typename Map>
double jacobian(const Map& map, double u, double v) {
  constexpr double kStep = 1.0 / 256;
  const auto p = [&](double a, double b) {
    return map(static_cast<float>(a), static_cast<float>(b));
  };
  const Vec3<float> du = p(u + kStep / 2, v) - p(u - kStep / 2, v),
                    dv = p(u, v + kStep / 2) - p(u, v - kStep / 2);
  return static_cast<double>(length(cross(du, dv))) / (kStep * kStep);
}

TEST(Warp, JacobianIsOneOverTheDensity) {
  std::mt19937 rng(6);
  for (int i = 0; i < 2000; ++i) {
    const double u = 0.02 + 0.96 * (rng() % 1000) / 1000.0,
                 v = 0.02 + 0.96 * (rng() % 1000) / 1000.0;
    // Avoids the creases of the concentric and triangle maps.
    if (std::fabs(u - v) < 0.01 || std::fabs(u + v - 1) < 0.01) continue;
    const auto disk = [](float a, float b) {
      const auto d = square_to_disk(a, b);
      return Vec3<float>(d.x, d.y, 0);
    };
    EXPECT_NEAR(jacobian(disk, u, v) / kPiD, 1, 2e-3);
    const auto triangle = [](float a, float b) {
      const auto d = square_to_triangle(a, b);
      return Vec3<float>(d.x, d.y, 0);
    };
    EXPECT_NEAR(jacobian(triangle, u, v), 0.5, 1e-3);
    const auto sphere = [](float a, float b) { return square_to_sphere(a, b); };
    EXPECT_NEAR(jacobian(sphere, u, v) / (4 * kPiD), 1, 5e-3);
    const auto cone = [](float a, float b) { return square_to_cone(a, b, 0.3f); };
    EXPECT_NEAR(jacobian(cone, u, v) / (2 * kPiD * 0.3), 1, 5e-3);
    const auto cosine = [](float a, float b) { return square_to_cosine_hemisphere(a, b); };
    const auto w = square_to_cosine_hemisphere(static_cast<float>(u), static_cast<float>(v));
    if (w.z > 0.2f) {
      EXPECT_NEAR(jacobian(cosine, u, v) * static_cast<double>(cosine_hemisphere_pdf(w.z)), 1,
                  1e-2);
    }
  }
}

TEST(Warp, CornersAreInRange) {
  for (const float u : {0.f, 0.5f, kOneMinusEpsilon, 0x1p-24f})
    for (const float v : {0.f, 0.5f, kOneMinusEpsilon, 0x1p-24f}) {
      const auto d = square_to_disk(u, v);
      EXPECT_LE(d.x * d.x + d.y * d.y, 1.000001f);
      for (const auto& w : {square_to_cosine_hemisphere(u, v), square_to_sphere(u, v),
                            square_to_cone(u, v, 2.f), square_to_cone(u, v, 1e-12f)}) {
        EXPECT_NEAR(length(w), 1, 1e-6);
      }
      EXPECT_GE(square_to_cosine_hemisphere(u, v).z, 0.f);
    }
}

TEST(Warp, Lanes) {
  const auto u = padded({0.f, 0.5f, kOneMinusEpsilon}, 4093, 0.f, kOneMinusEpsilon, 1);
  const auto v = padded({0.5f, 0.5f, 0.f}, 4093, 0.f, kOneMinusEpsilon, 2);
  expect_lanes_agree(u, v, [](auto a, auto b) { return square_to_disk(a, b).x; }, "disk");
  expect_lanes_agree(u, v, [](auto a, auto b) { return square_to_disk(a, b).y; }, "disk");
  expect_lanes_agree(
      u, v, [](auto a, auto b) { return square_to_cosine_hemisphere(a, b).z; }, "hemisphere");
  expect_lanes_agree(u, v, [](auto a, auto b) { return square_to_sphere(a, b).x; }, "sphere");
  expect_lanes_agree(
      u, v, [](auto a, auto b) { return square_to_cone(a, b, decltype(a)(0.1f)).y; }, "cone");
  expect_lanes_agree(u, v, [](auto a, auto b) { return square_to_triangle(a, b).x; }, "triangle");
  expect_lanes_agree(u, v, [](auto a, auto b) { return square_to_triangle(a, b).y; }, "triangle");
}

}  // namespace
}  // namespace wavecomb
