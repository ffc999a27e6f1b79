// SPDX-License-Identifier: Apache-2.0
/// Integer hash functions. Every random number of a render is a hash of the pixel, sample,
/// dimension and seed.
#pragma once

#include "wavecomb/core/lanes/lanes.h"

namespace wavecomb {

/// Bijective 32-bit integer hash ("lowbias32" by C. Wellons, found by hash-prospector, 2018).
template <typename U>
inline U hash_u32(U x) {
  x ^= x >> 16;
  x *= 0x7feb352du;
  x ^= x >> 15;
  x *= 0x846ca68bu;
  x ^= x >> 16;
  return x;
}

/// Hashes two 32-bit words; the second may be the same in all lanes. If one word is fixed, the hash
/// is a bijective function of the other word, so that two pixels never have the same random numbers
/// for the same seed.
template <typename U>
inline U hash_u32(const U& a, const std::type_identity_t<U>& b) {
  return hash_u32<U>(hash_u32<U>(a) + b * 0x9e3779b9u);
}

/// Converts the top 24 bits of a hash to a float in [0, 1).
template <typename F>
inline F unit_float(const UInt<F>& x) {
  return F(Int<F>(x >> 8)) * 0x1p-24f;
}

}  // namespace wavecomb
