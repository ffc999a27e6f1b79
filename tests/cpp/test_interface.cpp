// SPDX-License-Identifier: Apache-2.0
/// Tests of diffuse bases below a rough interface, compared with double-precision integrals.
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "bsdf_testing.h"
#include "wavecomb/material/programs/dielectric.h"
#include "wavecomb/material/programs/plastic.h"
#include "wavecomb/material/programs/principled.h"

namespace wavecomb {
namespace {

using bsdf_testing::direction;
using bsdf_testing::furnace;
using bsdf_testing::plain_params;
using Params = OpenPbrParams<float>;
using Vec = Vec3<float>;

constexpr double kCosines[] = {0.1, 0.2, 0.4, 0.7, 1.0};
constexpr float kRoughnesses[] = {0.05f, 0.1f, 0.2f, 0.3f, 0.45f, 0.6f, 0.8f, 1.f};

/// Exact reflectance of a dielectric of relative index eta, and the cosine of the refracted ray.
struct Crossing {
  double reflectance, cos_t;
};
Crossing exact(double c, double eta) {
  const double t2 = 1 - (1 - c * c) / (eta * eta);
  if (t2 <= 0) return {1, 0};
  const double t = std::sqrt(t2), p = (eta * c - t) / (eta * c + t),
               s = (c - eta * t) / (c + eta * t);
  return {0.5 * (p * p + s * s), t};
}

/// Single-bounce albedos of reflection and transmission of a GGX interface at cosine z, computed as
/// means of G2 / G1 over visible normals. Does not use the code under test.
struct Albedo {
  double reflected, transmitted;
};
Albedo albedo(double z, double alpha, double eta, bool schlick = false, double f0 = 0.04) {
  constexpr int kSteps = 160;
  const double s = std::sqrt(1 - z * z), length = std::hypot(alpha * s, z);
  const double kx = alpha * s / length, kz = z / length;
  const auto lambda = [alpha](double x, double y, double w) {
    return std::sqrt(w * w + alpha * alpha * (x * x + y * y));
  };
  const double so = lambda(s, 0, z);
  Albedo sum{0, 0};
  for (int i = 0; i < kSteps; ++i)
    for (int j = 0; j < kSteps; ++j) {
      const double phi = std::numbers::pi * (i + 0.5) / kSteps, v = (j + 0.5) / kSteps;
      const double nz = (1 - v) * (1 + kz), cap = nz - kz;
      const double r = std::sqrt(std::max(0.0, 1 - cap * cap));
      double h[3] = {alpha * (r * std::cos(phi) + kx), alpha * r * std::sin(phi), nz};
      const double n = std::sqrt(h[0] * h[0] + h[1] * h[1] + h[2] * h[2]);
      for (double& x : h) x /= n;
      const double c = std::clamp(s * h[0] + z * h[2], 0.0, 1.0);
      const auto [f, t] = exact(c, eta);
      const double reflectance = schlick ? f0 + (1 - f0) * std::pow(1 - c, 5) : f;
      const auto kept = [&](double x, double y, double w) {
        const double zi = std::abs(w);
        return zi * (z + so) / (z * lambda(x, y, w) + zi * so);
      };
      const double up = 2 * c * h[2] - z;
      if (up > 0) sum.reflected += reflectance * kept(2 * c * h[0] - s, 2 * c * h[1], up);
      const double k = c / eta - t, down = h[2] * k - z / eta;
      if (t > 0 && down < 0) sum.transmitted += (1 - f) * kept(h[0] * k - s / eta, h[1] * k, down);
    }
  return {sum.reflected / (kSteps * kSteps), sum.transmitted / (kSteps * kSteps)};
}

template <typename Bsdf>
void expect_base(Params p, const char* name, bool schlick, double f0, double back) {
  const double alpha = double{p.roughness} * double{p.roughness};
  for (const double z : kCosines) {
    const double e = albedo(z, alpha, static_cast<double>(p.ior), schlick, f0).reflected;
    for (const float base : {0.f, 0.2f, 1.f}) {
      p.base_color = Vec(base);
      // The base reflects the transmitted light, and all of this light leaves through the
      // interface.
      const double expected = e + static_cast<double>(base) * (1 - e);
      const double found = furnace(Bsdf(p, schlick), direction(z, 0.4), 10000);
      EXPECT_GE(found, expected - 0.008)
          << name << " r " << p.roughness << " ior " << p.ior << " z " << z << " base " << base;
      EXPECT_LE(found, expected + 0.004 + back * (1 - static_cast<double>(base)))
          << name << " r " << p.roughness << " ior " << p.ior << " z " << z << " base " << base;
    }
  }
}

TEST(RoughInterface, DiffuseBasesHaveWhatItLeaves) {
  for (const float r : kRoughnesses)
    for (const float ior : {1.2f, 1.5f, 2.f}) {
      Params p = plain_params();
      p.roughness = r;
      p.ior = ior;
      expect_base<PlasticBsdf<float>>(p, "plastic", false, 0, 0);
      // The program "principled" adds light for multiple scattering, which is a fraction of the
      // squared reflectance.
      expect_base<PrincipledBsdf<float>>(p, "principled", false, 0, 0.012);
    }
}

TEST(RoughInterface, SchlicksTooWhereItIsAskedFor) {
  for (const float r : kRoughnesses) {
    Params p = plain_params();
    p.roughness = r;
    expect_base<PlasticBsdf<float>>(p, "plastic", true, 0.04, 0);
    expect_base<PrincipledBsdf<float>>(p, "principled", true, 0.04, 0.012);
  }
}

TEST(RoughInterface, WhiteUnderAnySpecularColorIsWhite) {
  // A white base is below a specular layer of reflectance 0.5. The fit of the lost energy is at
  // most 2 % too low.
  for (const float r : kRoughnesses) {
    Params p = plain_params();
    p.roughness = r;
    p.base_color = Vec(1.f);
    p.flags = kSpecularWorkflow;
    p.specular_color = Vec(0.5f);
    const PrincipledBsdf<float> bsdf(p, false);
    for (const double z : kCosines) {
      const double found = furnace(bsdf, direction(z, 0.4), 10000);
      EXPECT_GE(found, 0.98) << r << " " << z;
      EXPECT_LE(found, 1.003) << r << " " << z;
    }
  }
}

TEST(RoughInterface, GlassLosesWhatOneBounceLoses) {
  for (const float r : {0.1f, 0.3f, 0.6f, 1.f})
    for (const float ior : {1.2f, 1.5f, 2.f})
      for (const double side : {1.0, -1.0})
        for (const double z : kCosines) {
          Params p = plain_params();
          p.base_color = Vec(1.f);
          p.roughness = r;
          p.ior = ior;
          const double eta = side > 0 ? static_cast<double>(ior) : 1 / static_cast<double>(ior);
          const Albedo a = albedo(z, double{r} * double{r}, eta);
          EXPECT_NEAR(furnace(DielectricBsdf<float>(p, false), direction(side * z, 0.4), 10000),
                      a.reflected + a.transmitted, 0.004)
              << r << " " << ior << " " << side * z;
        }
}

}  // namespace
}  // namespace wavecomb
