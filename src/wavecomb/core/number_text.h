// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cmath>
#include <cstdio>
#include <string>

namespace wavecomb {

/// A number as messages have it, whole numbers below 10^15 with all their digits, others with 6:
/// "1048576", "0.25", "1e+30".
inline std::string text(double v) {
  if (v == std::floor(v) && std::abs(v) < 1e15) return std::to_string(static_cast<long long>(v));
  char digits[32];
  std::snprintf(digits, sizeof(digits), "%g", v);
  return digits;
}

}  // namespace wavecomb
