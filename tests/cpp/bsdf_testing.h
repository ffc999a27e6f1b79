// SPDX-License-Identifier: Apache-2.0
/// Helpers for tests of programs and lobes: directions and their charts for chi_square.h, sample
/// points, white furnaces, and parameters. The helpers compute in double precision.
#pragma once

#include <cmath>
#include <vector>

#include "chi_square.h"
#include "numbers_testing.h"
#include "wavecomb/material/bsdf.h"
#include "wavecomb/material/energy_tables.h"
#include "wavecomb/material/openpbr_params.h"

namespace wavecomb::bsdf_testing {

using numbers_testing::kPiD;

inline Vec3<float> direction(double cos_theta, double phi) {
  const double r = std::sqrt(std::max(0.0, 1 - cos_theta * cos_theta));
  return {static_cast<float>(r * std::cos(phi)), static_cast<float>(r * std::sin(phi)),
          static_cast<float>(cos_theta)};
}

/// Charts of directions: chart 0 is the upper hemisphere, and chart 1 is the lower hemisphere. The
/// coordinates are x = 1 - |cos theta| and y = azimuth, so that the solid angle dw is dx dy, and no
/// precision is lost at the poles.
inline std::vector<chi_square::Chart> direction_charts() {
  return {{0, 1, -kPiD, kPiD}, {0, 1, -kPiD, kPiD}};
}
inline chi_square::Place place_of(const Vec3<float>& w) {
  const double x = w.x, y = w.y, z = std::abs(static_cast<double>(w.z));
  const double r2 = x * x + y * y, length = std::sqrt(r2 + z * z);
  return {std::signbit(w.z), r2 / (length * (length + z)), std::atan2(y, x)};
}
inline Vec3<float> direction_at(const chi_square::Place& p) {
  const double r = std::sqrt(p.x * (2 - p.x)), z = 1 - p.x;
  return {static_cast<float>(r * std::cos(p.y)), static_cast<float>(r * std::sin(p.y)),
          static_cast<float>(p.chart ? -z : z)};
}

/// Points of a low-discrepancy sequence in the unit cube (Roberts' R3).
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

/// Returns the radiance that a material reflects in a white furnace, which is the mean sample
/// weight of the brightest channel. Scaling of radiance by refraction is left out.
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

/// Returns default material parameters with the given colour.
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

/// Converts `p` to the parameter type of program `Bsdf`. Parameters that only one program has are
/// set to the fraction `own` of their range.
template <typename Bsdf, typename F>
ParamsOf<Bsdf, F> params_for(const OpenPbrParams<F>& p, float own = 0.5f) {
  constexpr const ProgramInfo& kInfo = info_of(Bsdf::kProgram);
  if constexpr (kInfo.specific_count() == 0) {
    return p;
  } else {
    SpecificShadingParams<F> more;
    static_cast<ShadingParams<F>&>(more) = p;
    for (size_t i = 0; i < kInfo.own.size(); ++i)
      more.own[i] = F(kInfo.own[i].least + own * (kInfo.own[i].most - kInfo.own[i].least));
    return more;
  }
}

}  // namespace wavecomb::bsdf_testing
