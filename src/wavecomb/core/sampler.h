// SPDX-License-Identifier: Apache-2.0
/// Sample values in [0, 1), which depend only on the pixel, sample index, sample set and seed, and
/// therefore not on scheduling.
///
/// The sampler uses hash-based Owen-scrambled Sobol points. A sample set has four dimensions.
/// Different sets use the same points in independently shuffled orders (Burley, "Practical
/// Hash-based Owen Scrambling", JCGT 9(4) 2020). The direction numbers of the Sobol sequence are
/// from Joe and Kuo, 2008.
#pragma once

#include "wavecomb/core/encoding/hash.h"
#include "wavecomb/core/rows/fields.h"
#include "wavecomb/core/settings_choices.h"

namespace wavecomb {

/// Key of the sample values of a path: a hash of the pixel and the seed, and the sample index.
template <typename F>
struct SampleKey {
  UInt<F> pixel_hash;
  UInt<F> sample;
  WAVECOMB_FIELDS(pixel_hash, sample)
};

template <typename F>
inline SampleKey<F> make_sample_key(const UInt<F>& pixel, const UInt<F>& sample, uint32_t seed) {
  return {hash_u32<UInt<F>>(pixel, UInt<F>(seed)), sample};
}

/// Returns a hash of a path, for random numbers that belong to no sample set.
template <typename F>
inline UInt<F> path_hash(const SampleKey<F>& key) {
  return hash_u32<UInt<F>>(key.pixel_hash, key.sample);
}

/// Four sample values in [0, 1).
template <typename F>
struct Sample4 {
  F x, y, z, w;
};

/// Indices of the sample sets that a path uses once: `kCameraSet` for the position on film and
/// lens, and another set for the shutter time.
inline constexpr uint32_t kCameraSet = 0;
inline constexpr uint32_t kTimeSet = 0xffffffffu;

/// Sample sets that a path uses at each vertex. Each step of a vertex has a named sample set, so
/// that adding or removing a step does not change the random numbers of other steps.
enum class VertexSet : uint32_t {
  kLight,     ///< selection of a light, (u, v) on the light, and Russian roulette
  kBsdf,      ///< BSDF sampling: lobe, u, v
  kFlight,    ///< distance sampling in media along the ray segment to the vertex (path/media.h)
  kShadow,    ///< transmittance along the vertex's shadow ray
  kEmission,  ///< start of a light path, at depth 0: choice of the light, and time
};
/// Upper limit of path depths that have distinct sample sets.
inline constexpr uint32_t kSetDepths = 1u << 23;

/// Returns the index of the sample set `name` at a depth of the path. The sets `kLight` and `kBsdf`
/// have the indices 1 + 2 * depth and 2 + 2 * depth. Each other vertex set has a separate block of
/// indices.
inline constexpr uint32_t vertex_set(VertexSet name, uint32_t depth) {
  const auto i = static_cast<uint32_t>(name);
  return i < 2 ? 1 + i + 2 * depth : (i << 24) + depth;
}

namespace detail {

/// Laine-Karras permutation. Bit k of the result depends only on the bits 0 to k of the input, so
/// that the permutation is an Owen scramble of bit-reversed values (constants from Burley 2020,
/// section 4).
template <typename U>
WAVECOMB_INLINE U laine_karras(U x, const U& seed) {
  x += seed;
  x ^= x * 0x6c50b47cu;
  x ^= x * 0xb82f1e52u;
  x ^= x * 0xc7afe638u;
  x ^= x * 0x8d22f6e6u;
  return x;
}

/// Number of bits of a sample index, for up to 2^20 samples per pixel.
inline constexpr int kIndexBits = 20;

/// Generator matrices of Sobol dimensions 2 and 3, with bit-reversed columns. Primitive
/// polynomials: x^2 + x + 1, x^3 + x + 1.
inline constexpr uint32_t kSobol2[kIndexBits] = {
    0x1,   0x3,   0x6,    0x9,    0x17,   0x3a,   0x71,    0xa3,    0x116,   0x339,
    0x677, 0x9aa, 0x1601, 0x3903, 0x7706, 0xaa09, 0x10117, 0x3033a, 0x60671, 0x909a3};
inline constexpr uint32_t kSobol3[kIndexBits] = {
    0x1,   0x3,   0x4,    0xa,    0x1f,   0x2e,   0x45,    0xc9,    0x11b,   0x2a4,
    0x79a, 0xb67, 0x101e, 0x302d, 0x4041, 0xa0c3, 0x1f104, 0x2e28a, 0x457df, 0xc9bae};

/// Multiplies the index by a generator matrix over GF(2), processing four bits of the index at a
/// time.
class NibbleTables {
 public:
  static constexpr int kNibbles = kIndexBits / 4;

  constexpr explicit NibbleTables(const uint32_t (&columns)[kIndexBits]) {
    for (int n = 0; n < kNibbles; ++n)
      for (uint32_t bits = 0; bits < 16; ++bits)
        for (int k = 0; k < 4; ++k)
          if (bits >> k & 1u) table_[n][bits] ^= columns[4 * n + k];
  }
  template <typename U>
  U product(const U& index) const {
    U result = lookup16<U>(table_[0], index & 15u);
    for (int n = 1; n < kNibbles; ++n) result ^= lookup16<U>(table_[n], (index >> (4 * n)) & 15u);
    return result;
  }

 private:
  alignas(64) uint32_t table_[kNibbles][16] = {};
};
inline constexpr NibbleTables kSobolTables2(kSobol2), kSobolTables3(kSobol3);

/// Returns the Owen-scrambled value in [0, 1) of a bit-reversed Sobol value.
template <typename F>
WAVECOMB_INLINE F scrambled(const UInt<F>& reversed, const UInt<F>& seed) {
  return unit_float<F>(reverse_bits<UInt<F>>(laine_karras<UInt<F>>(reversed, seed)));
}

template <typename F>
WAVECOMB_INLINE Sample4<F> sobol_4d(const SampleKey<F>& key, uint32_t set) {
  using U = UInt<F>;
  const U seed = hash_u32<U>(key.pixel_hash, U(set));
  // Shuffle the order of the points, so that different sample sets are independent.
  const U index = reverse_bits<U>(laine_karras<U>(reverse_bits<U>(key.sample), seed)) &
                  ((1u << kIndexBits) - 1u);
  // The bit-reversed value of dimension 0 is the index. The bit-reversed value of dimension 1 is
  // the product of Pascal's matrix modulo 2 and the index.
  U d1 = index;
  d1 ^= d1 >> 16;
  d1 ^= (d1 & 0xff00ff00u) >> 8;
  d1 ^= (d1 & 0xf0f0f0f0u) >> 4;
  d1 ^= (d1 & 0xccccccccu) >> 2;
  d1 ^= (d1 & 0xaaaaaaaau) >> 1;
  const U d2 = kSobolTables2.product<U>(index), d3 = kSobolTables3.product<U>(index);
  return {scrambled<F>(index, hash_u32<U>(seed ^ 0x1u)), scrambled<F>(d1, hash_u32<U>(seed ^ 0x2u)),
          scrambled<F>(d2, hash_u32<U>(seed ^ 0x3u)), scrambled<F>(d3, hash_u32<U>(seed ^ 0x4u))};
}

template <typename F>
inline Sample4<F> independent_4d(const SampleKey<F>& key, uint32_t set) {
  using U = UInt<F>;
  const U a = hash_u32<U>(path_hash<F>(key), U(set));
  return {unit_float<F>(hash_u32<U>(a ^ 0x68bc21ebu)), unit_float<F>(hash_u32<U>(a ^ 0x02e5be93u)),
          unit_float<F>(hash_u32<U>(a ^ 0x967a889bu)), unit_float<F>(hash_u32<U>(a ^ 0x368cc8b7u))};
}

}  // namespace detail

/// Returns the four sample values of a sample set for the path in each lane, inlined.
template <typename F>
WAVECOMB_INLINE Sample4<F> inlined_sample_4d(SamplerKind kind, const SampleKey<F>& key,
                                             uint32_t set) {
  return kind == SamplerKind::kSobol ? detail::sobol_4d<F>(key, set)
                                     : detail::independent_4d<F>(key, set);
}

/// Returns inlined_sample_4d(). Kernels call this function without inlining it
/// (wave/kernels/shared_kernels.h).
template <typename F>
Sample4<F> sample_4d(SamplerKind kind, const SampleKey<F>& key, uint32_t set) {
  return inlined_sample_4d<F>(kind, key, set);
}

/// Returns a value in [0, 1) for the decision `name` of a path. Over the samples of a pixel, the
/// values of one decision are stratified, and those of different decisions are independent.
template <typename F>
inline F stratified_1d(const SampleKey<F>& key, const UInt<F>& name) {
  using U = UInt<F>;
  const U seed = hash_u32<U>(key.pixel_hash ^ 0x3c6ef372u, name);
  const U index = reverse_bits<U>(detail::laine_karras<U>(reverse_bits<U>(key.sample), seed)) &
                  ((1u << detail::kIndexBits) - 1u);
  return detail::scrambled<F>(index, hash_u32<U>(seed ^ 0x1u));
}

}  // namespace wavecomb
