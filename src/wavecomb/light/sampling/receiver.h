// SPDX-License-Identifier: Apache-2.0
/// Point that a light sample illuminates.
#pragma once

#include "wavecomb/core/math.h"
#include "wavecomb/core/vec.h"

namespace wavecomb {

/// Point to illuminate.
template <typename F>
struct LightReceiver {
  Vec3<F> p;
  /// Packed normal (pack_normal) of the side at which light must arrive; 0 for both sides.
  UInt<F> normal;
  /// Seed for random bits below the precision of the random number that selects a light.
  UInt<F> seed;
  F time;  ///< shutter time, used if lights move; mid-shutter by default

  /// Creates a receiver at which light may arrive from any side.
  LightReceiver(const Vec3<F>& p_) : p(p_), normal(0u), seed(0u), time(0.5f) {}
  explicit LightReceiver(const Vec3<F>& p_, const UInt<F>& normal_)
      : p(p_), normal(normal_), seed(0u), time(0.5f) {}
};

/// Packs a unit vector with ten bits for each component. The packed normal is never 0.
template <typename F>
inline UInt<F> pack_normal(const Vec3<F>& n) {
  const auto steps = [](const F& x) {
    return UInt<F>(to_int<F>(clamp(F(fma(x, F(511.f), F(512.5f))), F(1.f), F(1023.f))));
  };
  return steps(n.x) | (steps(n.y) << 10) | (steps(n.z) << 20);
}

namespace detail {

template <typename F>
inline Vec3<F> unpack_normal(const UInt<F>& n) {
  const auto component = [](const UInt<F>& steps) {
    return F((F(Int<F>(steps & 1023u)) - 512.f) * (1.f / 511.f));
  };
  return {component(n), component(UInt<F>(n >> 10)), component(UInt<F>(n >> 20))};
}

}  // namespace detail

}  // namespace wavecomb
