// SPDX-License-Identifier: Apache-2.0
/// Sums whose order does not matter: integers in units of a power of two.
#pragma once

#include <cmath>
#include <cstdint>

namespace wavecomb {

/// Real numbers as multiples of 2^exponent.
struct FixedPoint {
  int exponent = -24;

  /// No summand is larger than this many units, so that a sum of 2^21 cannot overflow.
  static constexpr int64_t kMost = int64_t{1} << 41;

  /// The nearest multiple, of ties the even one. What is larger than kMost is cut there; NaN
  /// counts 0.
  int64_t from(float x) const {
    const double units = std::ldexp(double{x}, -exponent);
    constexpr auto most = static_cast<double>(kMost);
    if (!(units > -most)) return std::isnan(units) ? 0 : -kMost;
    return units < most ? static_cast<int64_t>(std::nearbyint(units)) : kMost;
  }
  double to_double(int64_t units) const { return std::ldexp(static_cast<double>(units), exponent); }
};

}  // namespace wavecomb
