// SPDX-License-Identifier: Apache-2.0
/// Counter-based sample values: every number is a function of (pixel, sample, set, seed) and of
/// nothing else, so no schedule can change it.
///
/// Owen-scrambled Sobol by hashing, four dimensions at a time, sets padded by independent shuffles
/// (Burley, "Practical Hash-based Owen Scrambling", JCGT 9(4) 2020). Direction numbers: Joe and Kuo
/// 2008.
#pragma once

#include "wavecomb/core/hash.h"
#include "wavecomb/core/settings.h"

namespace wavecomb {

/// What the values of one path are keyed by: a hash of (pixel, seed) and the sample's number.
template <typename F>
struct SampleKey {
  UInt<F> pixel_hash;
  UInt<F> sample;
};

template <typename F>
inline SampleKey<F> make_sample_key(const UInt<F>& pixel, const UInt<F>& sample, uint32_t seed) {
  return {hash_u32<UInt<F>>(pixel, UInt<F>(seed)), sample};
}

/// Four numbers in [0, 1).
template <typename F>
struct Sample4 {
  F x, y, z, w;
};

/// Sets of four dimensions. A path's first set places it on the film and the lens; each vertex has
/// two: one for its light (choice, u, v, roulette), one for its BSDF (lobe, u, v, light-texture
/// spare).
inline constexpr uint32_t kCameraSet = 0;
inline constexpr uint32_t light_set(uint32_t depth) {
  return 1 + 2 * depth;
}
inline constexpr uint32_t bsdf_set(uint32_t depth) {
  return 2 + 2 * depth;
}

namespace detail {

template <typename U>
inline U reverse_bits(U x) {
  x = ((x >> 1) & 0x55555555u) | ((x & 0x55555555u) << 1);
  x = ((x >> 2) & 0x33333333u) | ((x & 0x33333333u) << 2);
  x = ((x >> 4) & 0x0f0f0f0fu) | ((x & 0x0f0f0f0fu) << 4);
  x = ((x >> 8) & 0x00ff00ffu) | ((x & 0x00ff00ffu) << 8);
  return (x >> 16) | (x << 16);
}

/// Laine and Karras' permutation: bit k of the result depends on bits 0..k only, so that on
/// reversed bits it is an Owen scramble (constants: Burley 2020, section 4).
template <typename U>
inline U laine_karras(U x, const U& seed) {
  x += seed;
  x ^= x * 0x6c50b47cu;
  x ^= x * 0xb82f1e52u;
  x ^= x * 0xc7afe638u;
  x ^= x * 0x8d22f6e6u;
  return x;
}

/// Bits of the sample number that are used: sequences of up to 2^20 samples a pixel.
inline constexpr int kIndexBits = 20;

/// Sobol dimensions 2 and 3, columns bit-reversed. Primitive polynomials: x^2 + x + 1, x^3 + x + 1.
inline constexpr uint32_t kSobol2[kIndexBits] = {
    0x1,   0x3,   0x6,    0x9,    0x17,   0x3a,   0x71,    0xa3,    0x116,   0x339,
    0x677, 0x9aa, 0x1601, 0x3903, 0x7706, 0xaa09, 0x10117, 0x3033a, 0x60671, 0x909a3};
inline constexpr uint32_t kSobol3[kIndexBits] = {
    0x1,   0x3,   0x4,    0xa,    0x1f,   0x2e,   0x45,    0xc9,    0x11b,   0x2a4,
    0x79a, 0xb67, 0x101e, 0x302d, 0x4041, 0xa0c3, 0x1f104, 0x2e28a, 0x457df, 0xc9bae};

/// Owen-scrambled point from a bit-reversed Sobol value.
template <typename F>
inline F scrambled(const UInt<F>& reversed, const UInt<F>& seed) {
  return unit_float<F>(reverse_bits<UInt<F>>(laine_karras<UInt<F>>(reversed, seed)));
}

template <typename F>
inline Sample4<F> sobol_4d(const SampleKey<F>& key, uint32_t set) {
  using U = UInt<F>;
  const U seed = hash_u32<U>(key.pixel_hash, U(set));
  // Shuffle the order of the points, so that sets are independent of one another.
  const U index = reverse_bits<U>(laine_karras<U>(reverse_bits<U>(key.sample), seed)) &
                  ((1u << kIndexBits) - 1u);
  // Dimension 0 reversed is the index; dimension 1 reversed is Pascal's matrix modulo 2.
  U d1 = index;
  d1 ^= d1 >> 16;
  d1 ^= (d1 & 0xff00ff00u) >> 8;
  d1 ^= (d1 & 0xf0f0f0f0u) >> 4;
  d1 ^= (d1 & 0xccccccccu) >> 2;
  d1 ^= (d1 & 0xaaaaaaaau) >> 1;
  U d2(0u), d3(0u);
  U bits = index;
  for (int k = 0; k < kIndexBits; ++k) {
    const U on = U(0u) - (bits & 1u);
    d2 ^= on & kSobol2[k];
    d3 ^= on & kSobol3[k];
    bits = bits >> 1;
  }
  return {scrambled<F>(index, hash_u32<U>(seed ^ 0x1u)), scrambled<F>(d1, hash_u32<U>(seed ^ 0x2u)),
          scrambled<F>(d2, hash_u32<U>(seed ^ 0x3u)), scrambled<F>(d3, hash_u32<U>(seed ^ 0x4u))};
}

template <typename F>
inline Sample4<F> independent_4d(const SampleKey<F>& key, uint32_t set) {
  using U = UInt<F>;
  const U a = hash_u32<U>(hash_u32<U>(key.pixel_hash, key.sample), U(set));
  return {unit_float<F>(hash_u32<U>(a ^ 0x68bc21ebu)), unit_float<F>(hash_u32<U>(a ^ 0x02e5be93u)),
          unit_float<F>(hash_u32<U>(a ^ 0x967a889bu)), unit_float<F>(hash_u32<U>(a ^ 0x368cc8b7u))};
}

}  // namespace detail

/// The values of one set of dimensions for each path.
template <typename F>
inline Sample4<F> sample_4d(SamplerKind kind, const SampleKey<F>& key, uint32_t set) {
  return kind == SamplerKind::kSobol ? detail::sobol_4d<F>(key, set)
                                     : detail::independent_4d<F>(key, set);
}

}  // namespace wavecomb
