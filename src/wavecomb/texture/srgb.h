// SPDX-License-Identifier: Apache-2.0
/// The sRGB transfer function (IEC 61966-2-1) for 8-bit values.
#pragma once

#include <array>
#include <bit>
#include <cstdint>

namespace wavecomb {

namespace detail {

/// Converts an sRGB-encoded value c in [0, 1] to linear, in double precision.
constexpr double srgb_to_linear(double c) {
  if (c <= 0.04045) return c / 12.92;
  const double x = (c + 0.055) / 1.055;
  // x^2.4 = x^2 y, where y is the fifth root of x^2. Newton's method computes y, starting above the
  // root.
  const double x2 = x * x;
  double y = 1;
  for (int i = 0; i < 60; ++i) y -= (y * y * y * y * y - x2) / (5 * y * y * y * y);
  return x2 * y;
}

/// Returns a table of the linear values of (i + offset) / 255.
constexpr std::array<float, 256> make_srgb_table(double offset) {
  std::array<float, 256> table{};
  for (int i = 0; i < 256; ++i) {
    table[static_cast<size_t>(i)] = static_cast<float>(srgb_to_linear((i + offset) / 255.0));
  }
  return table;
}

}  // namespace detail

/// Linear value of each 8-bit sRGB code.
inline constexpr std::array<float, 256> kSrgbToLinear = detail::make_srgb_table(0);

namespace detail {

/// Linear values of i + 0.5 for each 8-bit sRGB code i, which are the rounding boundaries between
/// codes.
inline constexpr std::array<float, 256> kSrgbSteps = make_srgb_table(0.5);

/// The floats from 2^-13 to 1 are divided into buckets by exponent and 8 mantissa bits. Each bucket
/// holds at most one rounding boundary.
inline constexpr int kSrgbBucketShift = 23 - 8;
inline constexpr uint32_t kSrgbFirstBits = (127u - 13u) << 23;
inline constexpr uint32_t kSrgbBuckets = (13u << 8) + 1;

/// Returns the sRGB code at the lower end of each bucket.
constexpr std::array<uint8_t, kSrgbBuckets> make_srgb_buckets() {
  std::array<uint8_t, kSrgbBuckets> buckets{};
  uint32_t value = 0;
  for (uint32_t i = 0; i < kSrgbBuckets; ++i) {
    const auto low = std::bit_cast<float>(kSrgbFirstBits + (i << kSrgbBucketShift));
    while (value < 255 && kSrgbSteps[value] <= low) ++value;
    buckets[i] = static_cast<uint8_t>(value);
  }
  return buckets;
}
inline constexpr std::array<uint8_t, kSrgbBuckets> kSrgbBucket = make_srgb_buckets();

}  // namespace detail

/// Converts a linear value to an 8-bit sRGB code, rounded to nearest after encoding. NaN gives 0.
inline uint8_t linear_to_srgb(float linear) {
  const float x = linear > 0x1p-13f ? (linear < 1.f ? linear : 1.f) : 0x1p-13f;
  const uint32_t bits = std::bit_cast<uint32_t>(x) - detail::kSrgbFirstBits;
  const uint8_t value = detail::kSrgbBucket[bits >> detail::kSrgbBucketShift];
  return static_cast<uint8_t>(value + (value < 255 && detail::kSrgbSteps[value] <= x));
}

}  // namespace wavecomb
