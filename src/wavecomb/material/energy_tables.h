// SPDX-License-Identifier: Apache-2.0
/// Tables of the directional albedo of rough interfaces. OpenPBR layers are scaled by these albedos
/// so that multiple scattering loses no energy (Turquin, "Practical multiple scattering
/// compensation for microfacet models", 2019).
#pragma once

#include <span>
#include <vector>

#include "wavecomb/core/math.h"
#include "wavecomb/core/vec.h"
#include "wavecomb/material/description/material.h"

namespace wavecomb {

/// Tables of directional albedos of GGX interfaces for a single bounce. The first tables are
/// indexed by cosine, roughness and index of refraction. Quadrature rules integrate the reflectance
/// of other microfacets. Further tables hold the albedos of anisotropic surfaces, indexed by
/// cosine, azimuth and both roughnesses.
class EnergyTables {
 public:
  /// Number of table nodes along sqrt(cosine), roughness (alpha = roughness^2), and the square root
  /// of (eta - 1) / (eta + 1). These spacings are denser near 0, where values change fast.
  static constexpr uint32_t kCosines = 32, kRoughnesses = 24, kIndices = 28;
  /// (eta - 1) / (eta + 1) of the last index node, for eta = kMaxIor = 10.
  static constexpr float kLastIndex = 9.f / 11.f;
  static constexpr uint32_t kPlane = kCosines * kRoughnesses, kVolume = kPlane * kIndices;
  /// Number of nodes of a quadrature rule. Each node uses two planes of the table, one for the
  /// square root of the cosine and one for the weight.
  static constexpr uint32_t kRule = 6, kRuleAt = kPlane + 3 * kVolume;
  /// Number of table nodes of anisotropic surfaces along |cos phi|, sqrt(alpha_y / alpha_x) and
  /// sqrt(alpha_x). The nodes along sqrt(cosine) are the same as for isotropic surfaces.
  static constexpr uint32_t kAzimuths = 8, kRatios = 8, kAlongs = 16;
  static constexpr uint32_t kBrushed = kCosines * kAzimuths * kRatios * kAlongs;
  static constexpr uint32_t kBrushedAt = kRuleAt + 2 * kRule * kPlane;
  static constexpr uint32_t kSize = kBrushedAt + 2 * kBrushed;
  /// Index of refraction for which anisotropic interfaces are tabulated.
  static constexpr float kBrushedIndex = 1.5f;

  /// Returns the tables of this process. The first call computes the tables, in about 0.1 seconds.
  /// The first call with `brushed` computes the tables of anisotropic surfaces, in another 0.1
  /// seconds. Thread-safe.
  static const EnergyTables& shared(bool brushed = true);

  const float* data() const { return values_.data(); }

 private:
  EnergyTables();
  void add_brushed();
  std::vector<float> values_;
};

/// Returns the energy tables for MaterialView::energy, or nullptr if no material needs them.
const float* energy_tables(std::span<const Material> materials);

/// Interpolated lookup of energy tables, one lookup in each lane. `table` is EnergyTables::data().
template <typename F>
struct EnergyLookup {
  const float* table;
  UInt<F> node;  ///< index of the table node below the cosine and the roughness
  F at_cosine, at_roughness;

  EnergyLookup(const float* values, const F& cosine, const F& roughness) : table(values) {
    using T = EnergyTables;
    const auto split = [](const F& x, uint32_t count, UInt<F>& below) {
      const F scaled = clamp(x, F(0.f), F(1.f)) * static_cast<float>(count - 1);
      const F whole = min(floor(scaled), F(static_cast<float>(count - 2)));
      below = UInt<F>(to_int<F>(whole));
      return F(scaled - whole);
    };
    UInt<F> i, j;
    at_cosine = split(safe_sqrt(cosine), T::kCosines, i);
    at_roughness = split(roughness, T::kRoughnesses, j);
    node = j * T::kCosines + i;
  }

  /// Returns the albedo of a white microfacet mirror.
  F white() const { return plane(UInt<F>(0u)); }
  /// Returns the reflection albedo of a dielectric of index eta >= 1, seen from outside.
  F reflected(const F& eta) const { return volume(0, eta); }
  /// Returns the albedo of reflection plus transmission for a relative index eta, from either side.
  F scattered(const F& eta) const {
    const Mask<F> out = eta >= 1.f;
    return select(out, volume(1, eta), volume(2, F(1.f / eta)));
  }

  /// Node of a quadrature rule: the cosine c between viewer and microfacet normal, and a weight w.
  /// The sum of w R(c) over k < EnergyTables::kRule is the albedo of microfacets of reflectance R.
  struct Seen {
    F cosine, weight;
  };
  Seen rule(uint32_t k) const {
    const auto at = [&](uint32_t which) {
      return plane(UInt<F>(T::kRuleAt + (2 * k + which) * T::kPlane));
    };
    return {sqr(at(0)), at(1)};
  }

 private:
  using T = EnergyTables;
  F plane(const UInt<F>& first) const {
    const auto read = [&](uint32_t offset) {
      return gather<F>(table, first + node + offset, Mask<F>(true));
    };
    const auto mix = [](const F& a, const F& b, const F& t) { return fma(F(b - a), t, a); };
    return mix(mix(read(0), read(1), at_cosine),
               mix(read(T::kCosines), read(T::kCosines + 1), at_cosine), at_roughness);
  }
  F volume(uint32_t which, const F& eta) const {
    const F s = F(eta - 1.f) / F(eta + 1.f);
    const F x = sqrt(clamp(F(s * (1.f / T::kLastIndex)), F(0.f), F(1.f))) *
                static_cast<float>(T::kIndices - 1);
    const F whole = min(floor(x), F(static_cast<float>(T::kIndices - 2)));
    const UInt<F> first = UInt<F>(to_int<F>(whole)) * T::kPlane + (T::kPlane + which * T::kVolume);
    const F low = plane(first), high = plane(first + T::kPlane);
    return fma(F(high - low), F(x - whole), low);
  }
};

/// Interpolated lookup of the albedos of anisotropic surfaces. `o` is above the surface, in the
/// frame whose x axis has roughness `ax`.
template <typename F>
struct BrushedLookup {
  const float* table;
  UInt<F> node;
  F at[4];  ///< interpolation weights along cosine, azimuth, ratio of roughnesses, and alpha_x

  BrushedLookup(const float* values, const Vec3<F>& o, const F& ax, const F& ay) : table(values) {
    using T = EnergyTables;
    const F r2 = max(fma(o.x, o.x, F(o.y * o.y)), F(1e-20f));
    const F x[4] = {safe_sqrt(o.z), F(abs(o.x) / sqrt(r2)), sqrt(F(ay / ax)), sqrt(ax)};
    constexpr uint32_t kCounts[4] = {T::kCosines, T::kAzimuths, T::kRatios, T::kAlongs};
    node = UInt<F>(0u);
    uint32_t stride = 1;
    for (size_t k = 0; k < 4; ++k) {
      const F scaled = clamp(x[k], F(0.f), F(1.f)) * static_cast<float>(kCounts[k] - 1);
      const F whole = min(floor(scaled), F(static_cast<float>(kCounts[k] - 2)));
      node = node + UInt<F>(to_int<F>(whole)) * stride;
      at[k] = scaled - whole;
      stride *= kCounts[k];
    }
  }

  /// Returns the albedo of a white microfacet mirror.
  F white() const { return value(0); }
  /// Returns the reflection albedo of a dielectric of index kBrushedIndex, seen from outside.
  F reflected() const { return value(1); }

 private:
  F value(uint32_t which) const {
    using T = EnergyTables;
    constexpr uint32_t kStrides[4] = {1, T::kCosines, T::kCosines * T::kAzimuths,
                                      T::kCosines * T::kAzimuths * T::kRatios};
    F corners[16];
    for (uint32_t c = 0; c < 16; ++c) {
      uint32_t offset = T::kBrushedAt + which * T::kBrushed;
      for (uint32_t k = 0; k < 4; ++k) offset += ((c >> k) & 1) * kStrides[k];
      corners[c] = gather<F>(table, node + offset, Mask<F>(true));
    }
    for (uint32_t k = 0, count = 8; k < 4; ++k, count /= 2)
      for (uint32_t c = 0; c < count; ++c)
        corners[c] = fma(F(corners[2 * c + 1] - corners[2 * c]), at[k], corners[2 * c]);
    return corners[0];
  }
};

}  // namespace wavecomb
