// SPDX-License-Identifier: Apache-2.0
/// The sRGB transfer function (IEC 61966-2-1) for 8-bit values.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>

namespace wavecomb {

namespace detail {

/// Linear light of the encoded value c in [0, 1], in double precision.
constexpr double srgb_to_linear(double c) {
  if (c <= 0.04045) return c / 12.92;
  const double x = (c + 0.055) / 1.055;
  // x^2.4 = x^2 y with y the fifth root of x^2, by Newton's method from above.
  const double x2 = x * x;
  double y = 1;
  for (int i = 0; i < 60; ++i) y -= (y * y * y * y * y - x2) / (5 * y * y * y * y);
  return x2 * y;
}

/// Linear light of (i + offset) / 255.
constexpr std::array<float, 256> make_srgb_table(double offset) {
  std::array<float, 256> table{};
  for (int i = 0; i < 256; ++i) {
    table[static_cast<size_t>(i)] = static_cast<float>(srgb_to_linear((i + offset) / 255.0));
  }
  return table;
}

}  // namespace detail

/// Linear light of each 8-bit sRGB value.
inline constexpr std::array<float, 256> kSrgbToLinear = detail::make_srgb_table(0);

/// The 8-bit sRGB value nearest to a linear one (nearest as encoded); NaN gives 0.
inline uint8_t linear_to_srgb(float linear) {
  // Entry i lies half a step above value i.
  static constexpr std::array<float, 256> kSteps = detail::make_srgb_table(0.5);
  const auto* end = kSteps.begin() + 255;
  return static_cast<uint8_t>(
      std::partition_point(kSteps.begin(), end, [linear](float step) { return step <= linear; }) -
      kSteps.begin());
}

}  // namespace wavecomb
