// SPDX-License-Identifier: Apache-2.0
/// Fixed-point numbers, whose sums do not depend on the order of addition.
#pragma once

#include <cmath>
#include <cstdint>

namespace wavecomb {

/// Fixed-point format: real numbers as integer multiples of 2^exponent.
struct FixedPoint {
  int exponent = -24;

  /// Largest magnitude of a value, in multiples of 2^exponent. With this limit, a sum of 2^21
  /// values cannot overflow.
  static constexpr int64_t kMax = int64_t{1} << 41;

  /// Rounds a real number to the nearest fixed-point number; ties are rounded to even. Clamps the
  /// result to [-kMax, kMax] and converts NaN to 0.
  int64_t from(float x) const {
    const double units = std::ldexp(double{x}, -exponent);
    constexpr auto most = static_cast<double>(kMax);
    if (!(units > -most)) return std::isnan(units) ? 0 : -kMax;
    return units < most ? static_cast<int64_t>(std::nearbyint(units)) : kMax;
  }
  double to_double(int64_t units) const { return std::ldexp(static_cast<double>(units), exponent); }
};

}  // namespace wavecomb
