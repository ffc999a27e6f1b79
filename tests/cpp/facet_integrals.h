// SPDX-License-Identifier: Apache-2.0
/// Integrals over the microfacets of a rough surface, in double precision with fixed quadrature
/// points, as references for energy tests. This code shares no code with the code under test.
#pragma once

#include <algorithm>
#include <cmath>
#include <numbers>
#include <vector>

namespace wavecomb::facet_integrals {

/// Returns the reflectance and the cosine of the refracted ray; 1 and 0 under total internal
/// reflection.
struct Crossing {
  double reflectance, cos_t;
};
/// Fresnel reflectance at cosine c for a dielectric of relative index eta (Born and Wolf, 1.5.2).
inline Crossing fresnel(double c, double eta) {
  const double t2 = 1 - (1 - c * c) / (eta * eta);
  if (t2 <= 0) return {eta < 1 ? 1.0 : 0.0, 0};
  const double t = std::sqrt(t2);
  if (eta == 1) return {0, t};
  const double p = (eta * c - t) / (eta * c + t), s = (c - eta * t) / (c + eta * t);
  return {0.5 * (p * p + s * s), t};
}

/// Mean Fresnel reflectance for diffuse light from outside: the integral of 2 F(c) c dc from 0 to
/// 1.
inline double mean_fresnel(double eta) {
  constexpr int kSteps = 4000;
  double sum = 0;
  for (int i = 0; i < kSteps; ++i) {
    const double c = (i + 0.5) / kSteps;
    sum += 2 * c * fresnel(c, eta).reflectance;
  }
  return sum / kSteps;
}

/// GGX microfacet normals that are visible from the direction with cosine `z` and azimuth `phi`.
/// All normals have equal weight (midpoints of the map of Dupuy and Benyoub, "Sampling Visible GGX
/// Normals with Spherical Caps", 2023). For each normal, the table stores the ratio G2 / G1 of the
/// reflected and of the refracted direction.
class SeenFacets {
 public:
  SeenFacets(double z, double phi, double ax, double ay, double eta, int steps = 96) {
    const double s = std::sqrt(std::max(0.0, 1 - z * z));
    const double ox = s * std::cos(phi), oy = s * std::sin(phi);
    const double length = std::sqrt(ax * ax * ox * ox + ay * ay * oy * oy + z * z);
    const double kx = ax * ox / length, ky = ay * oy / length, kz = z / length;
    const auto slant = [&](double x, double y, double w) {
      return std::sqrt(w * w + ax * ax * x * x + ay * ay * y * y);
    };
    const double so = slant(ox, oy, z);
    const auto kept = [&](double x, double y, double w) {
      const double zi = std::abs(w);
      return zi * (z + so) / (z * slant(x, y, w) + zi * so);
    };
    facets_.reserve(static_cast<size_t>(2 * steps * steps));
    for (int i = 0; i < 2 * steps; ++i)
      for (int j = 0; j < steps; ++j) {
        const double turn = std::numbers::pi * (i + 0.5) / steps, v = (j + 0.5) / steps;
        const double nz = (1 - v) * (1 + kz), cap = nz - kz;
        const double r = std::sqrt(std::max(0.0, 1 - cap * cap));
        double h[3] = {ax * (r * std::cos(turn) + kx), ay * (r * std::sin(turn) + ky), nz};
        const double n = std::sqrt(h[0] * h[0] + h[1] * h[1] + h[2] * h[2]);
        for (double& x : h) x /= n;
        Facet f{std::clamp(ox * h[0] + oy * h[1] + z * h[2], 0.0, 1.0), 0, 0};
        const double up = 2 * f.cosine * h[2] - z;
        if (up > 0) f.up = kept(2 * f.cosine * h[0] - ox, 2 * f.cosine * h[1] - oy, up);
        const double t = fresnel(f.cosine, eta).cos_t, k = f.cosine / eta - t;
        const double down = h[2] * k - z / eta;
        if (t > 0 && down < 0) f.down = kept(h[0] * k - ox / eta, h[1] * k - oy / eta, down);
        facets_.push_back(f);
      }
  }

  /// Returns the mean reflection. `reflectance` is a function of the cosine between the microfacet
  /// normal and the viewing direction.
  template <typename Reflectance>
  double up(Reflectance reflectance) const {
    return mean([&](const Facet& f) { return reflectance(f.cosine) * f.up; });
  }
  /// Returns the mean transmission. `transmittance` is a function of the cosine between the
  /// microfacet normal and the viewing direction.
  template <typename Transmittance>
  double down(Transmittance transmittance) const {
    return mean([&](const Facet& f) { return transmittance(f.cosine) * f.down; });
  }

  struct Facet {
    double cosine, up, down;
  };
  /// Returns the mean of a function over all visible microfacets.
  template <typename Function>
  double mean(Function function) const {
    double sum = 0;
    for (const Facet& f : facets_) sum += function(f);
    return sum / static_cast<double>(facets_.size());
  }
  const std::vector<Facet>& facets() const { return facets_; }

 private:
  std::vector<Facet> facets_;
};

}  // namespace wavecomb::facet_integrals
