// SPDX-License-Identifier: Apache-2.0
/// Conversion between IEEE 754 binary16 and float.
#pragma once

#include "wavecomb/core/lanes/lanes.h"

namespace wavecomb {

/// Converts the half in the low 16 bits to float. The conversion is exact, including infinities and
/// NaN. The computation uses no denormal floats, so that flush-to-zero modes have no effect.
template <typename F>
inline F half_to_float(const UInt<F>& half) {
  const UInt<F> exponent = half & 0x7c00u;
  const UInt<F> shifted = (half & 0x7fffu) << 13;
  // Add 127 - 15 = 112 to the exponent. For infinity and NaN, add 112 twice: from 31 to 143 to 255.
  const UInt<F> again = select(exponent == UInt<F>(0x7c00u), UInt<F>(112u << 23), UInt<F>(0u));
  const UInt<F> normal = shifted + (112u << 23) + again;
  const F denormal = F(Int<F>(half & 0x3ffu)) * 0x1p-24f;
  const UInt<F> bits = select(exponent == UInt<F>(0u), float_bits<F>(denormal), normal);
  return bits_float<F>(bits | ((half & 0x8000u) << 16));
}

/// Converts to the nearest half, ties to even. Overflow gives infinity; NaN stays NaN. The function
/// has no branches, so that compilers vectorise loops that call it.
inline uint16_t float_to_half(float x) {
  const uint32_t bits = float_bits<float>(x);
  const uint32_t sign = (bits >> 16) & 0x8000u;
  const uint32_t magnitude = bits & 0x7fffffffu;
  const uint32_t rounded = (magnitude + 0xfffu + ((magnitude >> 13) & 1u) - (112u << 23)) >> 13;
  // Below 2^-14, adding 0.5 rounds to a multiple of 2^-24 in the low bits of the sum.
  const uint32_t small =
      float_bits<float>(bits_float<float>(magnitude) + 0.5f) - float_bits<float>(0.5f);
  uint32_t half = magnitude < 0x38800000u ? small : rounded;
  half = magnitude >= 0x477ff000u ? 0x7c00u : half;  // 65520 and above
  half = magnitude > 0x7f800000u ? 0x7e00u : half;
  return static_cast<uint16_t>(sign | half);
}

}  // namespace wavecomb
