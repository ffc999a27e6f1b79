// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/material/energy_tables.h"

#include <algorithm>
#include <cmath>

#include "wavecomb/material/lobes/ggx.h"
#include "wavecomb/material/lobes/smooth_dielectric.h"

namespace wavecomb {
namespace {

using F = FloatP<16>;  // lanes are samples

/// Roberts' low-discrepancy sequence R2; half of the azimuths, by symmetry.
struct Numbers {
  static constexpr uint32_t kCount = 1536;
  alignas(64) float u[kCount], v[kCount];

  Numbers() {
    for (uint32_t i = 0; i < kCount; ++i) {
      const auto step = [i](double x) {
        const double t = 0.5 + x * (i + 1.0);
        return static_cast<float>(t - std::floor(t));
      };
      u[i] = 0.5f * step(0.7548776662466927);
      v[i] = step(0.5698402909980532);
    }
  }
};

struct Albedo {
  float white, reflected, transmitted;
};

/// Means over visible normals of G2 / G1, times Fresnel's share.
Albedo integrate(const Numbers& numbers, float z, float roughness, float eta_) {
  const Ggx<F> ggx{F(std::max(roughness * roughness, kDeltaAlpha))};
  const Vec3<F> wo(F(std::sqrt(1 - z * z)), F(0.f), F(z));
  const F eta(eta_);
  F white(0.f), reflected(0.f), transmitted(0.f);
  for (uint32_t i = 0; i < Numbers::kCount; i += 16) {
    const Vec3<F> h = ggx.sample_visible(wo, load<F>(numbers.u + i), load<F>(numbers.v + i));
    const F c = clamp(dot(wo, h), F(0.f), F(1.f));
    const auto [r, t] = fresnel_dielectric(c, eta);
    const Vec3<F> up = reflect(wo, h), down = refract(wo, h, c, t, eta);
    const F back = select(up.z > 0.f, ggx.g2_over_g1(wo, up), F(0.f));
    const F through = select((down.z < 0.f) & (t > 0.f), ggx.g2_over_g1(wo, down), F(0.f));
    white += back;
    reflected = fma(r, back, reflected);
    transmitted = fma(F(1.f - r), through, transmitted);
  }
  // A little more than the mean, so that no interpolated value gives energy.
  const auto mean = [](const F& lanes) {
    float sum = 0;
    for (size_t i = 0; i < 16; ++i) sum += lane(lanes, i);
    return sum * (1.003f / Numbers::kCount);
  };
  return {mean(white), mean(reflected), mean(transmitted)};
}

}  // namespace

EnergyTables::EnergyTables() : values_(kPlane + 3 * size_t{kVolume}) {
  const Numbers numbers;
  for (uint32_t n = 0; n < kIndices; ++n)
    for (uint32_t j = 0; j < kRoughnesses; ++j)
      for (uint32_t i = 0; i < kCosines; ++i) {
        const float root = static_cast<float>(i) / (kCosines - 1);
        const float z = std::clamp(root * root, 1e-3f, 1.f);
        const float roughness = static_cast<float>(j) / (kRoughnesses - 1);
        const float s_root = static_cast<float>(n) / (kIndices - 1);
        const float s = s_root * s_root * kLastIndex;
        const float eta = std::max((1 + s) / (1 - s), 1.001f);
        const size_t node = size_t{j} * kCosines + i, at = kPlane + size_t{n} * kPlane + node;
        const Albedo out = integrate(numbers, z, roughness, eta),
                     in = integrate(numbers, z, roughness, 1 / eta);
        if (n == 0) values_[node] = out.white;
        values_[at] = out.reflected;
        values_[at + kVolume] = out.reflected + out.transmitted;
        values_[at + 2 * size_t{kVolume}] = in.reflected + in.transmitted;
      }
}

const EnergyTables& EnergyTables::shared() {
  static const EnergyTables tables;
  return tables;
}

}  // namespace wavecomb
