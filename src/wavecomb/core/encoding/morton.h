// SPDX-License-Identifier: Apache-2.0
/// Morton (Z-order) codes.
#pragma once

#include <cstdint>

namespace wavecomb {

/// Spreads the low 16 bits of x to the even bits.
template <typename U>
inline U spread_bits_2(U x) {
  x &= 0xffffu;
  x = (x | (x << 8)) & 0x00ff00ffu;
  x = (x | (x << 4)) & 0x0f0f0f0fu;
  x = (x | (x << 2)) & 0x33333333u;
  x = (x | (x << 1)) & 0x55555555u;
  return x;
}

/// Spreads the low 10 bits of x to every third bit.
template <typename U>
inline U spread_bits_3(U x) {
  x &= 0x3ffu;
  x = (x | (x << 16)) & 0x030000ffu;
  x = (x | (x << 8)) & 0x0300f00fu;
  x = (x | (x << 4)) & 0x030c30c3u;
  x = (x | (x << 2)) & 0x09249249u;
  return x;
}

/// Interleaves two 16-bit coordinates, x in the lower bit.
template <typename U>
inline U morton_2(const U& x, const U& y) {
  return spread_bits_2(x) | (spread_bits_2(y) << 1);
}

/// Interleaves three 10-bit coordinates, x in the lowest bit.
template <typename U>
inline U morton_3(const U& x, const U& y, const U& z) {
  return spread_bits_3(x) | (spread_bits_3(y) << 1) | (spread_bits_3(z) << 2);
}

/// Moves the even bits of x to the low 16 bits. The function is the inverse of `spread_bits_2`.
inline uint32_t compact_bits_2(uint32_t x) {
  x &= 0x55555555u;
  x = (x | (x >> 1)) & 0x33333333u;
  x = (x | (x >> 2)) & 0x0f0f0f0fu;
  x = (x | (x >> 4)) & 0x00ff00ffu;
  x = (x | (x >> 8)) & 0x0000ffffu;
  return x;
}

}  // namespace wavecomb
