// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/material/energy_tables.h"

#include <algorithm>
#include <cmath>
#include <mutex>

#include "wavecomb/material/gauss_rule.h"
#include "wavecomb/material/lobes/ggx_anisotropic.h"
#include "wavecomb/material/lobes/smooth_dielectric.h"

namespace wavecomb {
namespace {

using F = FloatP<16>;  // each lane processes one sample
constexpr uint32_t kSamples = 1536;

/// Sample values of Roberts' low-discrepancy sequence R2. `u` covers only half of the azimuths,
/// because an isotropic surface is symmetric.
struct Numbers {
  alignas(64) float u[kSamples], v[kSamples];

  Numbers() {
    for (uint32_t i = 0; i < kSamples; ++i) {
      const auto step = [i](double x) {
        const double t = 0.5 + x * (i + 1.0);
        return static_cast<float>(t - std::floor(t));
      };
      u[i] = 0.5f * step(0.7548776662466927);
      v[i] = step(0.5698402909980532);
    }
  }
};

/// Returns the mean of all samples, given their sum in each lane. The mean is raised by 0.3 %, so
/// that scaling by an interpolated albedo never adds energy.
float mean(const F& lanes) {
  float sum = 0;
  for (size_t i = 0; i < 16; ++i) sum += lane(lanes, i);
  return sum * (1.003f / kSamples);
}

/// Sampled visible microfacet normals for a viewing direction. `cosine` is the cosine between
/// normal and viewing direction, and `up` is G2 / G1 for the reflected direction.
struct Normals {
  Ggx<F> ggx{F(0.f)};
  Vec3<F> wo;
  alignas(64) float x[kSamples], y[kSamples], z[kSamples], cosine[kSamples], up[kSamples];

  void add_view(const Numbers& numbers, float cos_o, float roughness) {
    ggx.alpha = F(std::max(roughness * roughness, kDeltaAlpha));
    wo = Vec3<F>(F(std::sqrt(1 - cos_o * cos_o)), F(0.f), F(cos_o));
    for (uint32_t i = 0; i < kSamples; i += 16) {
      const Vec3<F> h = ggx.sample_visible(wo, load<F>(numbers.u + i), load<F>(numbers.v + i));
      const Vec3<F> w = reflect(wo, h);
      store(x + i, h.x);
      store(y + i, h.y);
      store(z + i, h.z);
      store(cosine + i, clamp(dot(wo, h), F(0.f), F(1.f)));
      store(up + i, select(w.z > 0.f, ggx.g2_over_g1(wo, w), F(0.f)));
    }
  }

  /// Returns the albedo of a white microfacet mirror.
  float white() const {
    F sum(0.f);
    for (uint32_t i = 0; i < kSamples; i += 16) sum += load<F>(up + i);
    return mean(sum);
  }

  struct Albedo {
    float reflected, transmitted;
  };
  /// Returns the albedos of a dielectric of relative index `index`.
  Albedo dielectric(float index) const {
    const F eta(index);
    F reflected(0.f), transmitted(0.f);
    for (uint32_t i = 0; i < kSamples; i += 16) {
      const Vec3<F> h(load<F>(x + i), load<F>(y + i), load<F>(z + i));
      const F c = load<F>(cosine + i);
      const auto [r, t] = fresnel_dielectric(c, eta);
      const Vec3<F> down = refract(wo, h, c, t, eta);
      const F through = select((down.z < 0.f) & (t > 0.f), ggx.g2_over_g1(wo, down), F(0.f));
      reflected = fma(r, load<F>(up + i), reflected);
      transmitted = fma(F(1.f - r), through, transmitted);
    }
    return {mean(reflected), mean(transmitted)};
  }

  std::vector<PointMass> points() const {
    std::vector<PointMass> all(kSamples);
    for (uint32_t i = 0; i < kSamples; ++i) all[i] = {double{cosine[i]}, double{up[i]} / kSamples};
    return all;
  }
};

float part(uint32_t i, uint32_t count) {
  return static_cast<float>(i) / static_cast<float>(count - 1);
}
float cosine_at(uint32_t i, uint32_t count) {
  return std::clamp(part(i, count) * part(i, count), 1e-3f, 1.f);
}

}  // namespace

EnergyTables::EnergyTables() : values_(kSize) {
  const Numbers numbers;
  Normals normals;
  for (uint32_t j = 0; j < kRoughnesses; ++j)
    for (uint32_t i = 0; i < kCosines; ++i) {
      const uint32_t node = j * kCosines + i;
      normals.add_view(numbers, cosine_at(i, kCosines), part(j, kRoughnesses));
      values_[node] = normals.white();
      float* rule = values_.data() + kRuleAt + node;
      for (const PointMass& p : gauss_rule<kRule>(normals.points())) {
        rule[0] = static_cast<float>(std::sqrt(std::clamp(p.x, 0.0, 1.0)));
        rule[kPlane] = static_cast<float>(p.weight);
        rule += 2 * size_t{kPlane};
      }
      for (uint32_t n = 0; n < kIndices; ++n) {
        const float s = part(n, kIndices) * part(n, kIndices) * kLastIndex;
        const float eta = (1 + s) / (1 - s);
        const auto out = normals.dielectric(eta), in = normals.dielectric(1 / eta);
        float* at = values_.data() + kPlane + size_t{n} * kPlane + node;
        at[0] = out.reflected;
        at[kVolume] = out.reflected + out.transmitted;
        at[2 * size_t{kVolume}] = in.reflected + in.transmitted;
      }
    }
}

void EnergyTables::add_brushed() {
  const Numbers numbers;
  const F eta(kBrushedIndex);
  float* at = values_.data() + kBrushedAt;
  for (uint32_t a = 0; a < kAlongs; ++a)
    for (uint32_t r = 0; r < kRatios; ++r) {
      const float ax = std::max(part(a, kAlongs) * part(a, kAlongs), kDeltaAlpha);
      const float ratio = part(r, kRatios) * part(r, kRatios);
      const AnisotropicGgx<F> ggx{F(ax), F(std::max(ax * ratio, kDeltaAlpha))};
      for (uint32_t p = 0; p < kAzimuths; ++p)
        for (uint32_t i = 0; i < kCosines; ++i, ++at) {
          const float z = cosine_at(i, kCosines), s = std::sqrt(1 - z * z);
          const float x = part(p, kAzimuths);
          const Vec3<F> wo(F(s * x), F(s * std::sqrt(1 - x * x)), F(z));
          F white(0.f), reflected(0.f);
          for (uint32_t k = 0; k < kSamples; k += 16) {
            // The factor 2 extends `u` to all azimuths, because an anisotropic surface is not
            // symmetric.
            const Vec3<F> h =
                ggx.sample_visible(wo, F(2.f * load<F>(numbers.u + k)), load<F>(numbers.v + k));
            const F c = clamp(dot(wo, h), F(0.f), F(1.f));
            const Vec3<F> up = reflect(wo, h);
            const F back = select(up.z > 0.f, ggx.g2_over_g1(wo, up), F(0.f));
            white += back;
            reflected = fma(fresnel_dielectric(c, eta).reflectance, back, reflected);
          }
          at[0] = mean(white);
          at[kBrushed] = mean(reflected);
        }
    }
}

const EnergyTables& EnergyTables::shared(bool brushed) {
  static EnergyTables tables;
  static std::once_flag once;
  if (brushed) std::call_once(once, [] { tables.add_brushed(); });
  return tables;
}

const float* energy_tables(std::span<const Material> materials) {
  bool layered = false, brushed = false;
  for (const Material& m : materials) {
    if (!has_trait(m.program, program_trait::kLayered)) continue;
    layered = true;
    brushed |= m.openpbr.anisotropy != 0 || m.graph != kNoGraph;
  }
  return layered ? EnergyTables::shared(brushed).data() : nullptr;
}

}  // namespace wavecomb
