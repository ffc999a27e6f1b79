// SPDX-License-Identifier: Apache-2.0
/// Warps: where samples go (chi-square), what a step in the square becomes (Jacobian), lanes.
#include "wavecomb/core/warp.h"

#include "bsdf_testing.h"
#include "lane_testing.h"

namespace wavecomb {
namespace {

using namespace lane_testing;
using bsdf_testing::chi_square_p;
constexpr double kPiD = 3.14159265358979323846;

/// p-value of a histogram of a warp. `cell` gives the bin of a sample, all bins are equally
/// probable.
template <typename Cell>
double uniformity(int cells, const Cell& cell, uint32_t seed) {
  std::mt19937 rng(seed);
  const int n = 400 * cells;
  std::vector<int> count(static_cast<size_t>(cells), 0);
  for (int i = 0; i < n; ++i) {
    const float u = static_cast<float>(rng() >> 8) * 0x1p-24f,
                v = static_cast<float>(rng() >> 8) * 0x1p-24f;
    const int c = cell(u, v);
    EXPECT_TRUE(c >= 0 && c < cells);
    ++count[static_cast<size_t>(std::clamp(c, 0, cells - 1))];
  }
  double statistic = 0;
  for (const int c : count) statistic += (c - 400.0) * (c - 400.0) / 400.0;
  return chi_square_p(statistic, cells - 1);
}

/// Bin of (x in [0, 1], angle of (a, b)) in a grid of 16 x 32.
int grid_cell(double x, double a, double b) {
  const double turn = std::atan2(b, a) / (2 * kPiD);
  const int row = std::clamp(static_cast<int>(x * 16), 0, 15);
  return row * 32 + std::clamp(static_cast<int>((turn < 0 ? turn + 1 : turn) * 32), 0, 31);
}

const double kLevel = bsdf_testing::sidak(0.01, 6);

TEST(Warp, DiskIsUniform) {
  // Equal areas: equal steps in r^2.
  EXPECT_GT(uniformity(
                512,
                [](float u, float v) {
                  const auto d = square_to_disk(u, v);
                  const double x = d.x, y = d.y;
                  return grid_cell(x * x + y * y, x, y);
                },
                1),
            kLevel);
}

TEST(Warp, CosineHemisphere) {
  // The cumulative of cos / pi over the polar angle is sin^2.
  EXPECT_GT(uniformity(
                512,
                [](float u, float v) {
                  const auto w = square_to_cosine_hemisphere(u, v);
                  return grid_cell(1 - static_cast<double>(w.z) * w.z, w.x, w.y);
                },
                2),
            kLevel);
  EXPECT_EQ(cosine_hemisphere_pdf(-0.5f), 0.f);
  EXPECT_FLOAT_EQ(cosine_hemisphere_pdf(1.f), kInvPi);
}

TEST(Warp, Sphere) {
  EXPECT_GT(uniformity(
                512,
                [](float u, float v) {
                  const auto w = square_to_sphere(u, v);
                  return grid_cell((1 - static_cast<double>(w.z)) / 2, w.x, w.y);
                },
                3),
            kLevel);
}

TEST(Warp, Cones) {
  for (const double one_minus_cos : {2.0, 0.5, 1e-5}) {
    EXPECT_GT(uniformity(
                  512,
                  [&](float u, float v) {
                    const auto w = square_to_cone(u, v, static_cast<float>(one_minus_cos));
                    // 1 - cos from the sine, for narrow cones: h (2 - h) = sin^2.
                    const double sin2 =
                        static_cast<double>(w.x) * w.x + static_cast<double>(w.y) * w.y;
                    const double h = w.z > 0 ? sin2 / (1 + std::sqrt(std::max(0.0, 1 - sin2)))
                                             : 1 - static_cast<double>(w.z);
                    return grid_cell(h / one_minus_cos, w.x, w.y);
                  },
                  4),
              kLevel)
        << one_minus_cos;
  }
}

TEST(Warp, TriangleIsUniform) {
  // Square root parametrization gives equal areas: (1 - sqrt-ish) cells of s = 1 - b0', t.
  EXPECT_GT(uniformity(
                256,
                [](float u, float v) {
                  const auto b = square_to_triangle(u, v);
                  const double b1 = b.x, b2 = b.y, sum = b1 + b2;
                  EXPECT_TRUE(b1 >= 0 && b2 >= 0 && sum <= 1 + 1e-6);
                  // P(b1 + b2 < s) = s^2, and b1 / sum is uniform.
                  const int row = std::clamp(static_cast<int>(sum * sum * 16), 0, 15);
                  const int column =
                      std::clamp(static_cast<int>(b1 / std::max(sum, 1e-30) * 16), 0, 15);
                  return row * 16 + column;
                },
                5),
            kLevel);
}

/// Area of the image of a small square around (u, v), by its two edges, over the square's.
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
    // Away from the creases of the concentric and triangle maps.
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
