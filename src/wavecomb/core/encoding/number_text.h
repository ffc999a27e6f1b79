// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cmath>
#include <cstdio>
#include <string>

namespace wavecomb {

/// Formats a number for messages, such as "1048576", "0.25" or "1e+30". Integers below 10^15 are
/// written with all digits, and other numbers with up to six digits.
inline std::string text(double v) {
  if (v == std::floor(v) && std::abs(v) < 1e15) return std::to_string(static_cast<long long>(v));
  char digits[32];
  std::snprintf(digits, sizeof(digits), "%g", v);
  return digits;
}

}  // namespace wavecomb
