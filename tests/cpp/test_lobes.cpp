// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <cmath>
#include <complex>
#include <random>

#include "bsdf_testing.h"
#include "wavecomb/material/lobes/coat.h"
#include "wavecomb/material/lobes/lambert.h"
#include "wavecomb/material/lobes/microfacet_reflection.h"
#include "wavecomb/material/lobes/rough_dielectric.h"

namespace wavecomb {
namespace {

using bsdf_testing::direction;
using Vec = Vec3<float>;
using Complex = std::complex<double>;

/// Fresnel equations for a complex refractive index, in the textbook form. The code under test uses
/// a different form.
double fresnel_reference(double cos_i, Complex n) {
  const Complex sin_t = std::sqrt(1 - cos_i * cos_i) / n;
  const Complex cos_t = std::sqrt(1.0 - sin_t * sin_t);
  const Complex rs = (cos_i - n * cos_t) / (cos_i + n * cos_t);
  const Complex rp = (n * cos_i - cos_t) / (n * cos_i + cos_t);
  return 0.5 * (std::norm(rs) + std::norm(rp));
}

TEST(Fresnel, DielectricMatchesReference) {
  for (double n : {1.0001, 1.1, 1.33, 1.5, 2.4, 4.0, 0.75, 1 / 1.5, 0.3})
    for (int i = 1; i <= 1000; ++i) {
      const double c = i / 1000.0;
      const float f = fresnel_dielectric(static_cast<float>(c), static_cast<float>(n)).reflectance;
      const double n_float = static_cast<float>(n), c_float = static_cast<float>(c);
      const bool critical = std::abs(n * n - (1 - c * c)) < 1e-3;
      EXPECT_NEAR(f, fresnel_reference(c_float, n_float), critical ? 2e-3 : 2e-6) << n << " " << c;
    }
}

TEST(Fresnel, KnownValues) {
  EXPECT_NEAR(fresnel_dielectric(1.f, 1.5f).reflectance, 0.04f, 1e-7f);
  EXPECT_NEAR(fresnel_dielectric(0.5f, 1.5f).reflectance, 0.0891867f, 1e-6f);  // 60 degrees
  // At Brewster's angle, whose tangent is n, only perpendicular polarisation is reflected. The
  // reflectance is ((n^2 - 1) / (n^2 + 1))^2 / 2.
  EXPECT_NEAR(fresnel_dielectric(1 / std::sqrt(1 + 2.25f), 1.5f).reflectance,
              0.5f * std::pow(1.25f / 3.25f, 2.f), 1e-6f);
  EXPECT_EQ(fresnel_dielectric(0.5f, 1 / 1.5f).reflectance, 1.f);
  EXPECT_EQ(fresnel_dielectric(0.5f, 1 / 1.5f).cos_t, 0.f);
  EXPECT_EQ(fresnel_dielectric(0.f, 1.5f).reflectance, 1.f);
  EXPECT_EQ(fresnel_dielectric(0.f, 1.f).reflectance, 0.f);
  EXPECT_LT(fresnel_dielectric(0.3f, 1.f).reflectance, 1e-12f);
  // The reflectance of an interface is the same for both directions of a light path.
  for (float c : {0.1f, 0.4f, 0.8f, 1.f}) {
    for (bool schlick : {false, true}) {
      const auto [r, t] = fresnel_dielectric(c, 1.5f, schlick);
      EXPECT_NEAR(r, fresnel_dielectric(t, 1 / 1.5f, schlick).reflectance, 2e-6f);
    }
  }
}

TEST(Fresnel, ConductorMatchesReference) {
  const double indices[][2] = {{0.143, 3.98}, {0.37, 2.82}, {1.44, 7.5},
                               {0.2, 1.1},    {3.1, 3.3},   {1.5, 0}};
  for (const auto& [eta, k] : indices)
    for (int i = 1; i <= 500; ++i) {
      const double c = static_cast<float>(i / 500.0);
      EXPECT_NEAR(
          fresnel_conductor(static_cast<float>(c), static_cast<float>(eta), static_cast<float>(k)),
          fresnel_reference(c, {eta, k}), 3e-6);
    }
  // Silver near 600 nm reflects about 98 % (n = 0.13, k = 4.0: ((n - 1)^2 + k^2) / ((n + 1)^2 +
  // k^2)).
  EXPECT_NEAR(fresnel_conductor(1.f, 0.13f, 4.f), (0.87 * 0.87 + 16) / (1.13 * 1.13 + 16), 1e-6);
}

TEST(Fresnel, F82TintHitsItsTwoColours) {
  const Vec f0(0.9f, 0.5f, 0.04f), tint(1.f, 0.7f, 0.2f);
  const F82Tint<float> f(f0, tint);
  const Vec at_0 = f(1.f), at_82 = f(1.f / 7.f), schlick = fresnel_schlick(f0, 1.f / 7.f);
  EXPECT_NEAR(at_0.x, f0.x, 1e-6f);
  EXPECT_NEAR(at_0.z, f0.z, 1e-6f);
  EXPECT_NEAR(at_82.x, schlick.x, 1e-5f);
  EXPECT_NEAR(at_82.y, 0.7f * schlick.y, 1e-5f);
  EXPECT_NEAR(at_82.z, 0.2f * schlick.z, 1e-5f);
  EXPECT_NEAR(f(0.f).y, 1.f, 1e-6f);
  // Compute the hemispherical mean, with parameters for which the model clamps no values.
  double mean = 0;
  for (int i = 0; i < 10000; ++i) {
    const float c = (static_cast<float>(i) + 0.5f) / 10000.f;
    mean += 2e-4 * static_cast<double>(c * f(c).y);
  }
  EXPECT_NEAR(mean, f.average().y, 1e-5);
}

TEST(Coat, AverageReflectanceIsCloseAndNeverAbove) {
  for (double n : {1.0, 1.01, 1.1, 1.2, 1.33, 1.5, 1.8, 2.4, 3.5, 6.0, 10.0}) {
    double mean = 0;
    for (int i = 0; i < 20000; ++i) {
      const double c = (i + 0.5) / 20000;
      mean += 1e-4 * c * fresnel_reference(c, n);
    }
    const double fit = average_fresnel_dielectric(static_cast<float>(n));
    EXPECT_LE(fit, mean + 1e-5) << n;
    EXPECT_GE(fit, mean - 1e-3) << n;
  }
}

TEST(Ggx, ProjectedNormalsCoverTheSurfaceOnce) {
  // int D(h) h.z dh = 1 (Walter et al. 2007, eq. 4), integrated over slopes: h.z^2 = 1 / (1 +
  // tan^2).
  for (float alpha : {0.01f, 0.1f, 0.5f, 1.f}) {
    const Ggx<float> ggx{alpha};
    double sum = 0;
    const int n = 20000;
    for (int i = 0; i < n; ++i) {
      // The substitution tan theta = alpha sqrt(x / (1 - x)) makes the integrand constant if D is
      // right.
      const double x = (i + 0.5) / n, tan2 = static_cast<double>(alpha) * alpha * x / (1 - x);
      const double z = 1 / std::sqrt(1 + tan2);
      const double dz_dx =
          0.5 * z * z * z * static_cast<double>(alpha) * alpha / ((1 - x) * (1 - x));
      sum += 2 * bsdf_testing::kPiD * z * static_cast<double>(ggx.d(direction(z, 0.3))) * dz_dx / n;
    }
    EXPECT_NEAR(sum, 1, 2e-4) << alpha;
  }
}

TEST(Ggx, VisibleNormalsProjectToTheViewersArea) {
  // int D(h) G1(wo) max(wo . h, 0) dh = z_o (Heitz 2014, eq. 14), with h importance sampled by D.
  for (float alpha : {0.05f, 0.3f, 1.f})
    for (double zo : {0.05, 0.3, 0.7, 1.0}) {
      const Vec wo = direction(zo, 0.7);
      const Ggx<float> ggx{alpha};
      double sum = 0;
      const int n = 400;
      for (int i = 0; i < n; ++i)
        for (int j = 0; j < n; ++j) {
          const double y = (i + 0.5) / n, x = 1 - (1 - y) * (1 - y);
          const double z = 1 / std::sqrt(1 + static_cast<double>(alpha) * alpha * x / (1 - x));
          const Vec h = direction(z, 2 * bsdf_testing::kPiD * (j + 0.5) / n);
          sum += 2 * (1 - y) * std::max(0.0, static_cast<double>(dot(wo, h))) / z;
        }
      EXPECT_NEAR(sum / (n * n) * static_cast<double>(ggx.g1(wo)) / zo, 1, 1e-2)
          << alpha << " " << zo;
    }
}

/// Returns the factor by which a map from the tangent plane at `w` to the sphere scales areas, by
/// central differences.
template <typename Map>
double numeric_jacobian(const Vec& w, Map map) {
  const float e = 4e-3f;
  const Vec a = normalize(cross(w, std::abs(w.x) < 0.7f ? Vec(1, 0, 0) : Vec(0, 1, 0)));
  const Vec b = cross(w, a);
  const Vec da = map(normalize(w + a * e)) - map(normalize(w - a * e));
  const Vec db = map(normalize(w + b * e)) - map(normalize(w - b * e));
  return static_cast<double>(length(cross(da, db))) / (4.0 * e * e);
}

TEST(Microfacet, HalfVectorJacobiansMatchFiniteDifferences) {
  std::mt19937 rng(3);
  std::uniform_real_distribution<double> unit(0, 1);
  for (int i = 0; i < 300; ++i) {
    const Vec wo = direction(0.1 + 0.9 * unit(rng), 7 * unit(rng));
    const Vec h = direction(0.3 + 0.7 * unit(rng), 7 * unit(rng));
    const float oh = dot(wo, h);
    if (oh < 0.15f) continue;
    const double reflection = numeric_jacobian(h, [&](const Vec& m) { return reflect(wo, m); });
    EXPECT_NEAR(reflection / (4.0 * oh), 1, 5e-3);
    for (float eta : {1.5f, 1 / 1.5f, 1.1f}) {
      const auto bend = [&](const Vec& m) {
        const float c = dot(wo, m);
        return refract(wo, m, c, refracted_cos(c, eta), eta);
      };
      const float cos_t = refracted_cos(oh, eta);
      if (cos_t < 0.25f) continue;
      const Vec wi = bend(h);
      EXPECT_NEAR(length(wi), 1, 1e-5f);
      // dwi / dh = (wi.h + wo.h / eta)^2 / |wi.h| (Walter et al. 2007, eq. 17).
      const double c = dot(wi, h) + oh / eta;
      const double formula = c * c / std::abs(dot(wi, h));
      EXPECT_NEAR(numeric_jacobian(h, bend) / formula, 1, 2e-2) << eta;
    }
  }
}

TEST(Microfacet, SampleMapStretchesByTheInverseDensity) {
  // |dwi/du x dwi/dv| pdf = 1 at any point of the unit square.
  std::mt19937 rng(5);
  std::uniform_real_distribution<float> unit(0.1f, 0.9f);
  for (int i = 0; i < 300; ++i) {
    const Vec wo = direction(unit(rng), 7 * unit(rng));
    const Ggx<float> ggx{0.2f + 0.8f * unit(rng)};
    const float u = unit(rng), v = unit(rng), e = 2e-3f;
    const Vec wi = sample_microfacet(ggx, wo, u, v);
    if (wi.z < 0.05f) continue;
    const Vec du = sample_microfacet(ggx, wo, u + e, v) - sample_microfacet(ggx, wo, u - e, v);
    const Vec dv = sample_microfacet(ggx, wo, u, v + e) - sample_microfacet(ggx, wo, u, v - e);
    const float area = length(cross(du, dv)) / (4 * e * e);
    EXPECT_NEAR(area * eval_microfacet(ggx, wo, wi).pdf, 1, 2e-2f);
  }
}

TEST(Lambert, SidesMirror) {
  EXPECT_EQ(side_of(Vec(0, 0, -1)), -1.f);
  EXPECT_EQ(mirror_z(Vec(1, 2, -3), -1.f).z, 3.f);
  EXPECT_EQ(lambert_cos(Vec(0, 0, -1)), 0.f);
  EXPECT_FLOAT_EQ(lambert_cos(Vec(0, 0, 1)), kInvPi);
}

}  // namespace
}  // namespace wavecomb
