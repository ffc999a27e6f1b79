// SPDX-License-Identifier: Apache-2.0
/// Tests of Gaussian splats: hits compared with a search along the ray, positions, bounds,
/// spherical harmonics, and invalid arrays.
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "curve_testing.h"
#include "wavecomb/geometry/curve/intersect.h"
#include "wavecomb/geometry/gaussian_splat/harmonics.h"
#include "wavecomb/geometry/hit/surface.h"

namespace wavecomb {
namespace {

using namespace curve_testing;

using Double3 = std::array<double, 3>;

/// Returns the squared Mahalanobis distance of a point from the centre of splat i.
double deviations(const GaussianSplatData& data, size_t i, const Double3& p) {
  const float* q = &data.orientations[4 * i];
  const double norm =
      double{q[0]} * q[0] + double{q[1]} * q[1] + double{q[2]} * q[2] + double{q[3]} * q[3];
  const double w = q[0], v[3] = {q[1], q[2], q[3]};
  const auto cross = [](const double* a, const double* b) {
    return Double3{a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
  };
  double d[3], sum = 0;
  for (size_t k = 0; k < 3; ++k) d[k] = p[k] - data.positions[3 * i + k];
  // Rotates the offset by the conjugate quaternion: d - 2 w (v x d) + 2 v x (v x d), over |q|^2.
  const Double3 once = cross(v, d), twice = cross(v, once.data());
  for (size_t k = 0; k < 3; ++k) {
    const double local = d[k] + 2 * (twice[k] - w * once[k]) / norm;
    sum += local * local / (double{data.scales[3 * i + k]} * data.scales[3 * i + k]);
  }
  return sum;
}

TEST(GaussianSplats, AreMetWhereTheirResponseIsGreatest) {
  const GaussianSplatData data = random_gaussian_splats(60, 1, 0.4f, 0, 3);
  const Mesh mesh = make_gaussian_splats(data, 0);
  const auto scene = [&] {
    SceneBuilder b;
    b.add_to_group(0, b.add_mesh(make_gaussian_splats(
                          data, b.add_material(make_material(ProgramId::kEmissive)))));
    return b.build();
  }();
  std::mt19937 rng(4);
  std::uniform_real_distribution<float> uniform(-1, 1);
  size_t met = 0;
  for (int r = 0; r < 150; ++r) {
    const float o[3] = {2 * uniform(rng), 2 * uniform(rng), 2 * uniform(rng)};
    float d[3];
    for (int k = 0; k < 3; ++k) d[k] = 0.7f * uniform(rng) - o[k];
    const CurveRay ray(o, d);
    const auto at = [&](double t) {
      return Double3{o[0] + t * d[0], o[1] + t * d[1], o[2] + t * d[2]};
    };
    for (uint32_t i = 0; i < mesh.splats.size(); ++i) {
      // The squared Mahalanobis distance is a parabola in t, so ternary search finds its minimum.
      double lo = -20, hi = 20;
      for (int step = 0; step < 90; ++step) {
        const double a = lo + (hi - lo) / 3, b = hi - (hi - lo) / 3;
        (deviations(data, i, at(a)) < deviations(data, i, at(b)) ? hi : lo) =
            deviations(data, i, at(a)) < deviations(data, i, at(b)) ? b : a;
      }
      const double t = 0.5 * (lo + hi), least = deviations(data, i, at(t));
      const double alpha = data.opacities[i] * std::exp(-0.5 * least);
      const CurveHits hits = intersect_curve(mesh, {i}, ray, kInfinity, CurveQuery::kAll);
      if (std::abs(alpha * 255 - 1) < 1e-3 || std::abs(least - 9) < 1e-3) continue;
      const bool expected = t > 0 && least < 9 && alpha > 1.0 / 255;
      ASSERT_EQ(!hits.empty(), expected) << "splat " << i << " at " << t;
      if (!expected) continue;
      ++met;
      const CurveHit& hit = *hits.begin();
      EXPECT_NEAR(hit.t, t, 1e-5);
      EXPECT_NEAR(hit.u * hit.u + hit.v * hit.v, least, 1e-4);
      EXPECT_NEAR(gaussian_splat_alpha(mesh.splats[i], hit.u, hit.v), alpha, 1e-4);
      const Bounds box = curve_bounds(mesh, i);
      const Double3 p = at(t);
      EXPECT_TRUE(p[0] > box.lo.x && p[1] > box.lo.y && p[2] > box.lo.z && p[0] < box.hi.x &&
                  p[1] < box.hi.y && p[2] < box.hi.z);
      const Vec3<float> dir = normalize(Vec3<float>(d[0], d[1], d[2]));
      const Surface<float> s =
          setup_surface<float>(scene->view(), {0, 0, i, hit.u, hit.v}, dir, true, true, true);
      EXPECT_NEAR(s.p.x, p[0], 2e-5);
      EXPECT_NEAR(s.p.y, p[1], 2e-5);
      EXPECT_NEAR(s.p.z, p[2], 2e-5);
      EXPECT_EQ(s.ng.x, -dir.x);
      EXPECT_TRUE(intersect_curve(mesh, {i}, ray, hit.t * 0.999f, CurveQuery::kAny).empty());
    }
  }
  EXPECT_GT(met, 400u);
}

TEST(GaussianSplats, HarmonicsAreOrthonormal) {
  // Use the midpoint rule in azimuth and a Gauss rule along the axis, which are exact for
  // polynomials up to degree 6.
  constexpr double kNode[4] = {0.1834346424956498, 0.5255324099163290, 0.7966664774136267,
                               0.9602898564975363};
  constexpr double kWeight[4] = {0.3626837833783620, 0.3137066458778873, 0.2223810344533745,
                                 0.1012285362903763};
  double product[kMaxHarmonics][kMaxHarmonics] = {};
  for (int i = 0; i < 8; ++i)
    for (int j = 0; j < 16; ++j) {
      const double z = i < 4 ? kNode[i] : -kNode[i - 4], s = std::sqrt(1 - z * z);
      const double phi = 2 * std::numbers::pi * j / 16;
      const auto y =
          harmonics<float>({static_cast<float>(s * std::cos(phi)),
                            static_cast<float>(s * std::sin(phi)), static_cast<float>(z)});
      const double weight = kWeight[i % 4] * 2 * std::numbers::pi / 16;
      for (size_t a = 0; a < kMaxHarmonics; ++a)
        for (size_t b = 0; b < kMaxHarmonics; ++b) product[a][b] += weight * y[a] * y[b];
    }
  for (size_t a = 0; a < kMaxHarmonics; ++a)
    for (size_t b = 0; b < kMaxHarmonics; ++b)
      EXPECT_NEAR(product[a][b], a == b ? 1 : 0, 1e-6) << a << " and " << b;
}

TEST(GaussianSplats, BadArraysAreRefused) {
  const auto refused = [](const auto& spoil, const std::string& what) {
    SceneBuilder b;
    const uint32_t material = b.add_material(make_material(ProgramId::kEmissive));
    GaussianSplatData data = random_gaussian_splats(5, 1, 0.3f, 1, 3);
    spoil(data);
    try {
      b.add_mesh(make_gaussian_splats(data, material));
      ADD_FAILURE() << "taken: " << what;
    } catch (const Error& error) {
      EXPECT_NE(std::string(error.what()).find(what), std::string::npos) << error.what();
    }
  };
  refused([](GaussianSplatData& d) { d.scales.pop_back(); }, "scales");
  refused([](GaussianSplatData& d) { d.scales[1] = 0; }, "a scale that is not");
  refused([](GaussianSplatData& d) { d.scales[2] = std::nanf(""); }, "a scale that is not");
  refused([](GaussianSplatData& d) { d.orientations.pop_back(); }, "orientations");
  refused([](GaussianSplatData& d) { std::fill_n(d.orientations.begin(), 4, 0.f); },
          "an orientation that");
  refused([](GaussianSplatData& d) { d.opacities[3] = -0.1f; }, "an opacity that");
  refused([](GaussianSplatData& d) { d.opacities[3] = 1.1f; }, "an opacity that");
  refused([](GaussianSplatData& d) { d.positions.resize(12); }, "rows of splats");
  refused([](GaussianSplatData& d) { d.positions[0] = INFINITY; }, "not finite");
  refused([](GaussianSplatData& d) { d.harmonics.pop_back(); }, "harmonics");
  refused([](GaussianSplatData& d) { d.harmonics[7] = INFINITY; }, "harmonics that are not finite");
  refused([](GaussianSplatData& d) { d.degree = 4; }, "degree above 3");
}

TEST(GaussianSplats, AreCounted) {
  SceneBuilder b;
  const uint32_t material = b.add_material(make_material(ProgramId::kEmissive));
  b.add_to_group(
      0, b.add_mesh(make_gaussian_splats(random_gaussian_splats(11, 1, 0.3f, 2, 3), material)));
  const auto scene = b.build();
  EXPECT_EQ(scene->splats(), 11u);
  EXPECT_EQ(scene->points(), 0u);
  EXPECT_EQ(scene->curve_segments(), 0u);
  EXPECT_EQ(scene->bytes().meshes, 11u * (12 + 4 + 64 + 9 * 12));
}

}  // namespace
}  // namespace wavecomb
