// SPDX-License-Identifier: Apache-2.0
/// How much a rough interface scatters, in tables: what OpenPBR's layers are scaled by so that no
/// energy is lost (Turquin, "Practical multiple scattering compensation for microfacet models",
/// 2019).
#pragma once

#include <vector>

#include "wavecomb/core/math.h"

namespace wavecomb {

/// Directional albedos of GGX for one bounce, by cosine, roughness and index.
class EnergyTables {
 public:
  /// Nodes by sqrt(cosine), by roughness (alpha = roughness^2) and by the root of
  /// (eta - 1) / (eta + 1): what changes fast is near 0.
  static constexpr uint32_t kCosines = 20, kRoughnesses = 20, kIndices = 20;
  /// The last node of indices: 10, kMaxIor.
  static constexpr float kLastIndex = 9.f / 11.f;
  static constexpr uint32_t kPlane = kCosines * kRoughnesses, kVolume = kPlane * kIndices;

  /// The tables of this process, worked out at the first call (some 0.1 s). Threads may call.
  static const EnergyTables& shared();

  const float* data() const { return values_.data(); }

 private:
  EnergyTables();
  std::vector<float> values_;
};

/// Reads the tables in lanes; `table` is EnergyTables::data().
template <typename F>
struct EnergyLookup {
  const float* table;
  UInt<F> node;  ///< of cosine and roughness
  F at_cosine, at_roughness;

  EnergyLookup(const float* values, const F& cosine, const F& roughness) : table(values) {
    using T = EnergyTables;
    const auto place = [](const F& x, uint32_t count, UInt<F>& below) {
      const F scaled = clamp(x, F(0.f), F(1.f)) * static_cast<float>(count - 1);
      const F whole = min(floor(scaled), F(static_cast<float>(count - 2)));
      below = UInt<F>(to_int<F>(whole));
      return F(scaled - whole);
    };
    UInt<F> i, j;
    at_cosine = place(safe_sqrt(cosine), T::kCosines, i);
    at_roughness = place(roughness, T::kRoughnesses, j);
    node = j * T::kCosines + i;
  }

  /// A white mirror's.
  F white() const { return plane(UInt<F>(0u)); }
  /// Reflection by a dielectric of index eta >= 1 seen from outside.
  F reflected(const F& eta) const { return volume(0, eta); }
  /// Reflection and transmission by one of relative index eta, from either side.
  F scattered(const F& eta) const {
    const Mask<F> out = eta >= 1.f;
    return select(out, volume(1, eta), volume(2, F(1.f / eta)));
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

}  // namespace wavecomb
