// SPDX-License-Identifier: Apache-2.0
/// Statistical tests of direction samplers: chi-square, mass, reciprocity, furnace. Double
/// precision around the float code under test.
///
/// From Python: a binding that gives eval and sample of a program for arrays of directions is all
/// that is needed. numpy.histogram2d over (cos theta, phi) of the samples, the same grid integrated
/// by eval (as integrate_pdf does), and scipy.stats.chi2.sf give this test for materials loaded
/// from USD.
#pragma once

#include <cmath>
#include <functional>
#include <random>
#include <string>
#include <vector>

#include "wavecomb/material/bsdf.h"
#include "wavecomb/material/energy_tables.h"
#include "wavecomb/material/openpbr_params.h"

namespace wavecomb::bsdf_testing {

inline constexpr double kPiD = 3.14159265358979323846;

/// A sampler with its density, scalar.
struct Sampler {
  std::function<float(const Vec3<float>& wi)> pdf;
  /// Returns false when there is no sample, or a delta one.
  std::function<bool(float u_lobe, float u, float v, Vec3<float>& wi)> sample;
};

inline Vec3<float> direction(double cos_theta, double phi) {
  const double r = std::sqrt(std::max(0.0, 1 - cos_theta * cos_theta));
  return {static_cast<float>(r * std::cos(phi)), static_cast<float>(r * std::sin(phi)),
          static_cast<float>(cos_theta)};
}

/// Points of a low-discrepancy sequence in the unit cube (Roberts' R3), in [0, 1).
struct Point3 {
  float x, y, z;
};
inline Point3 kronecker(uint32_t i) {
  constexpr double kStep[3] = {0.8191725133961645, 0.6710436067037893, 0.5497004779019703};
  float p[3];
  for (int k = 0; k < 3; ++k) {
    const double t = 0.5 + kStep[k] * (i + 1.0);
    p[k] = std::min(static_cast<float>(t - std::floor(t)), 0x1.fffffep-1f);
  }
  return {p[0], p[1], p[2]};
}

/// Probability that a chi-square variable of `dof` degrees of freedom exceeds x: the regularised
/// upper incomplete gamma function Q(dof / 2, x / 2) (Numerical Recipes, section 6.2).
inline double chi_square_p(double x, double dof) {
  const double a = 0.5 * dof, y = 0.5 * x;
  if (y <= 0) return 1;
  const double front = std::exp(-y + a * std::log(y) - std::lgamma(a));
  if (y < a + 1) {
    double term = 1 / a, sum = term;
    for (int n = 1; n < 10000 && term > sum * 1e-15; ++n) sum += term *= y / (a + n);
    return 1 - sum * front;
  }
  double b = y + 1 - a, c = 1e300, d = 1 / b, h = d;
  for (int i = 1; i < 10000; ++i) {
    const double an = -i * (i - a);
    b += 2;
    d = 1 / (an * d + b);
    c = b + an / c;
    const double delta = d * c;
    h *= delta;
    if (std::abs(delta - 1) < 1e-14) break;
  }
  return front * h;
}

/// Level of each of `tests` independent tests that together err with probability `level` (Sidak).
inline double sidak(double level, size_t tests) {
  return 1 - std::pow(1 - level, 1.0 / static_cast<double>(tests));
}

struct Cell {
  double z0, z1, phi0, phi1;
};

/// Integral of the density over a cell by 3 x 3 Gauss points, refined where four children disagree.
inline double integrate_pdf(const Sampler& s, const Cell& c, double tolerance, int depth) {
  const auto gauss = [&s](const Cell& k) {
    constexpr double kNode = 0.7745966692414834;
    constexpr double kX[3] = {-kNode, 0, kNode}, kW[3] = {5.0 / 18, 8.0 / 18, 5.0 / 18};
    double sum = 0;
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 3; ++j) {
        const double z = 0.5 * (k.z0 + k.z1) + 0.5 * (k.z1 - k.z0) * kX[i];
        const double phi = 0.5 * (k.phi0 + k.phi1) + 0.5 * (k.phi1 - k.phi0) * kX[j];
        sum += kW[i] * kW[j] * static_cast<double>(s.pdf(direction(z, phi)));
      }
    return sum * (k.z1 - k.z0) * (k.phi1 - k.phi0);
  };
  const double zm = 0.5 * (c.z0 + c.z1), pm = 0.5 * (c.phi0 + c.phi1);
  const Cell child[4] = {{c.z0, zm, c.phi0, pm},
                         {zm, c.z1, c.phi0, pm},
                         {c.z0, zm, pm, c.phi1},
                         {zm, c.z1, pm, c.phi1}};
  double sum = 0;
  for (const Cell& k : child) sum += gauss(k);
  const bool must = depth > 7;  // always look this closely, lest a narrow lobe be missed
  if (depth == 0 || (!must && std::abs(sum - gauss(c)) < tolerance)) return sum;
  sum = 0;
  for (const Cell& k : child) sum += integrate_pdf(s, k, 0.5 * tolerance, depth - 1);
  return sum;
}

struct ChiSquareResult {
  double p_value;
  double mass;      ///< integral of the density
  double accepted;  ///< share of the samples that were neither invalid nor delta
};

/// Compares a histogram of samples in (cos theta, phi) with the integrated density. The rest
/// (invalid and delta samples) is one more cell, so the mass of the density is tested too.
inline ChiSquareResult chi_square(const Sampler& s, uint32_t seed, int samples = 100000,
                                  int rows = 20, int columns = 20) {
  std::vector<double> observed(static_cast<size_t>(rows * columns) + 1), expected(observed.size());
  std::mt19937 rng(seed);
  const auto number = [&rng] { return static_cast<float>(rng() >> 8) * 0x1p-24f; };
  double accepted = 0;
  for (int i = 0; i < samples; ++i) {
    const float a = number(), b = number(), c = number();
    Vec3<float> wi;
    if (!s.sample(a, b, c, wi)) {
      observed.back() += 1;
      continue;
    }
    accepted += 1;
    double phi = std::atan2(static_cast<double>(wi.y), static_cast<double>(wi.x)) / (2 * kPiD);
    if (phi < 0) phi += 1;
    const int row = std::clamp(static_cast<int>((wi.z * 0.5 + 0.5) * rows), 0, rows - 1);
    const int column = std::clamp(static_cast<int>(phi * columns), 0, columns - 1);
    observed[static_cast<size_t>(row * columns + column)] += 1;
  }
  double mass = 0;
  for (int r = 0; r < rows; ++r)
    for (int c = 0; c < columns; ++c) {
      const Cell cell{-1 + 2.0 * r / rows, -1 + 2.0 * (r + 1) / rows, 2 * kPiD * c / columns,
                      2 * kPiD * (c + 1) / columns};
      const double p = integrate_pdf(s, cell, 1e-6, 9);
      mass += p;
      expected[static_cast<size_t>(r * columns + c)] = p * samples;
    }
  expected.back() = std::max(0.0, 1 - mass) * samples;

  double statistic = 0, pooled_o = 0, pooled_e = 0;
  int used = 0;
  for (size_t i = 0; i < observed.size(); ++i) {
    if (expected[i] < 5) {
      pooled_o += observed[i];
      pooled_e += expected[i];
      continue;
    }
    statistic += (observed[i] - expected[i]) * (observed[i] - expected[i]) / expected[i];
    ++used;
  }
  if (pooled_e >= 5) {
    statistic += (pooled_o - pooled_e) * (pooled_o - pooled_e) / pooled_e;
    ++used;
  } else if (pooled_o > pooled_e + 25) {  // counts where the density has almost nothing
    return {0, mass, accepted / samples};
  }
  const double p = used > 1 ? chi_square_p(statistic, used - 1) : 1;
  return {p, mass, accepted / samples};
}

/// Light seen on a surface in a uniform white surrounding: the mean weight in the brightest
/// channel, radiance scaling undone.
template <typename Bsdf>
double furnace(const Bsdf& bsdf, const Vec3<float>& wo, uint32_t samples = 40000) {
  double sum[3] = {0, 0, 0};
  for (uint32_t i = 0; i < samples; ++i) {
    const auto [l, u, v] = kronecker(i);
    const auto s = bsdf.sample(wo, l, u, v);
    const Vec3<float> w = s.weight * (s.eta * s.eta);
    sum[0] += static_cast<double>(w.x);
    sum[1] += static_cast<double>(w.y);
    sum[2] += static_cast<double>(w.z);
  }
  return std::max({sum[0], sum[1], sum[2]}) / samples;
}

/// Parameters at their defaults, with a colour.
inline OpenPbrParams<float> plain_params() {
  const Vec3<float> black(0.f), white(1.f);
  OpenPbrParams<float> p{};
  p.base_color = {0.8f, 0.5f, 0.2f};
  p.specular_color = p.emission = p.conductor_eta = p.conductor_k = p.extinction = black;
  p.roughness = p.fuzz_roughness = 0.5f;
  p.metallic = p.clearcoat = 0;
  p.clearcoat_roughness = 0.01f;
  p.opacity = 1;
  p.normal = {0, 0, 1};
  p.ior = 1.5f;
  p.flags = 0;
  p.specular_weight = p.coat_darkening = 1;
  p.transmission_tint = p.fuzz_color = p.coat_color = white;
  p.subsurface_color = {0.8f, 0.8f, 0.8f};
  p.coat_ior = 1.6f;
  p.film_thickness = 500;
  p.film_ior = 1.4f;
  p.energy = EnergyTables::shared().data();
  return p;
}

}  // namespace wavecomb::bsdf_testing
