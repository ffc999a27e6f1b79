// SPDX-License-Identifier: Apache-2.0
/// Procedural noise as defined by MaterialX: gradient noise (Perlin, "Improving Noise", 2002) on
/// Bob Jenkins' lookup3 hash of the lattice, cell noise, and distances to jittered points (Worley,
/// "A Cellular Texture Basis Function", 1996). The scales and gradients are the same as in Open
/// Shading Language and in MaterialX's code generators.
#pragma once

#include "wavecomb/core/math.h"
#include "wavecomb/core/vec.h"

namespace wavecomb::noise {

/// Clamps x so that its floor and the indices of neighbouring cells fit an integer; NaN becomes 0.
template <typename F>
inline F bounded(const F& x) {
  return clamp(select(x == x, x, F(0.f)), F(-1e9f), F(1e9f));
}

template <typename U>
inline U rotate_left(const U& x, uint32_t k) {
  return (x << k) | (x >> (32 - k));
}

/// Returns Jenkins' lookup3 hash of N words. The first three words are mixed together, and then a
/// fourth.
template <typename U, size_t N>
inline U hash(const U (&words)[N]) {
  static_assert(N >= 1 && N <= 4);
  U a(0xdeadbeefu + 4u * static_cast<uint32_t>(N) + 13u), b = a, c = a;
  a = a + words[0];
  if constexpr (N > 1) b = b + words[1];
  if constexpr (N > 2) c = c + words[2];
  if constexpr (N > 3) {
    const auto mix = [](U& x, U& y, U& z, uint32_t k) {
      x = (x - z) ^ rotate_left(z, k);
      z = z + y;
    };
    mix(a, b, c, 4);
    mix(b, c, a, 6);
    mix(c, a, b, 8);
    mix(a, b, c, 16);
    mix(b, c, a, 19);
    mix(c, a, b, 4);
    a = a + words[3];
  }
  const auto last = [](U& x, const U& y, uint32_t k) { x = (x ^ y) - rotate_left(y, k); };
  last(c, b, 14);
  last(a, c, 11);
  last(b, a, 25);
  last(c, b, 16);
  last(a, c, 4);
  last(b, a, 14);
  last(c, b, 24);
  return c;
}

/// Converts 32 bits to a float in [0, 1].
template <typename F>
inline F unit_of(const UInt<F>& bits) {
  // Convert the two 16-bit halves separately, which is exact and avoids a slow conversion of
  // unsigned integers.
  const F high = F(Int<F>(bits >> 16)), low = F(Int<F>(bits & 0xffffu));
  return fma(high, F(65536.f), low) * (1.f / 4294967296.f);
}

template <typename F>
inline F fade(const F& t) {
  return t * t * t * fma(t, fma(t, F(6.f), F(-15.f)), F(10.f));
}

/// Returns `x`, or -x if bit `bit` of `hash` is set.
template <typename F>
inline F signed_by(const F& x, const UInt<F>& hash, uint32_t bit) {
  return bits_float<F>(float_bits<F>(x) ^ ((hash >> bit) << 31));
}

/// Scalar product with one of the 8 gradients (+-1, +-2) and (+-2, +-1).
template <typename F>
inline F gradient(const UInt<F>& h, const F (&p)[2]) {
  const Mask<F> swap = Mask<F>((h & 4u) != UInt<F>(0u));
  const F u = select(swap, p[1], p[0]), v = select(swap, p[0], p[1]);
  return signed_by<F>(u, h, 0) + signed_by<F>(F(2.f * v), h, 1);
}
/// Scalar product with one of 12 gradients, which point to the edge midpoints of a cube.
template <typename F>
inline F gradient(const UInt<F>& hash, const F (&p)[3]) {
  using U = UInt<F>;
  const U h = hash & 15u;
  const F u = select(Mask<F>(h < U(8u)), p[0], p[1]);
  const Mask<F> first = Mask<F>(h == U(12u)) | Mask<F>(h == U(14u));
  const F v = select(Mask<F>(h < U(4u)), p[1], select(first, p[0], p[2]));
  return signed_by<F>(u, h, 0) + signed_by<F>(v, h, 1);
}

/// Evaluates gradient noise in N dimensions, range about [-1, 1]. Writes K (1 or 3) uncorrelated
/// noise values.
template <size_t K, typename F, size_t N>
inline void perlin(const F (&p)[N], F* out) {
  using U = UInt<F>;
  static_assert(K == 1 || K == 3);
  constexpr size_t kCorners = size_t{1} << N;
  U cell[N];
  F part[N], weight[N];
  for (size_t i = 0; i < N; ++i) {
    const F x = bounded<F>(p[i]), base = floor(x);
    cell[i] = U(to_int<F>(base));
    part[i] = x - base;
    weight[i] = fade(part[i]);
  }
  F corner[K][kCorners];
  for (uint32_t c = 0; c < kCorners; ++c) {
    U at[N];
    F away[N];
    for (uint32_t i = 0; i < N; ++i) {
      const uint32_t up = c >> i & 1u;
      at[i] = cell[i] + up;
      away[i] = part[i] - static_cast<float>(up);
    }
    const U h = hash(at);
    for (uint32_t k = 0; k < K; ++k) {
      if constexpr (K == 1)
        corner[0][c] = gradient<F>(h, away);
      else
        corner[k][c] = gradient<F>((h >> (8 * k)) & 0xffu, away);
    }
  }
  constexpr float kScale = N == 2 ? 0.6616f : 0.982f;
  for (size_t k = 0; k < K; ++k) {
    for (size_t i = 0, n = kCorners / 2; i < N; ++i, n /= 2)
      for (size_t c = 0; c < n; ++c)
        corner[k][c] = fma(F(corner[k][2 * c + 1] - corner[k][2 * c]), weight[i], corner[k][2 * c]);
    out[k] = corner[k][0] * kScale;
  }
}

/// Returns the hashed value in [0, 1] of the lattice cell of `p`.
template <typename F, size_t N>
inline F cell(const F (&p)[N]) {
  UInt<F> at[N];
  for (size_t i = 0; i < N; ++i) at[i] = UInt<F>(to_int<F>(floor(bounded<F>(p[i]))));
  return unit_of<F>(hash(at));
}
/// Returns the k-th hashed value of the lattice cell of `p`.
template <typename F, size_t N>
inline F cell(const F (&p)[N], uint32_t k) {
  UInt<F> at[N + 1];
  for (size_t i = 0; i < N; ++i) at[i] = UInt<F>(to_int<F>(floor(bounded<F>(p[i]))));
  at[N] = UInt<F>(k);
  return unit_of<F>(hash(at));
}

/// Distances to the three nearest feature points in ascending order, and the hashed value of the
/// cell with the nearest feature point.
template <typename F>
struct Worley {
  F nearest[3], cell;
};
/// Evaluates Worley noise in N dimensions. A `jitter` of 0 puts the feature points at the cell
/// centres.
template <typename F, size_t N>
inline Worley<F> worley(const F (&p)[N], const F& jitter) {
  using U = UInt<F>;
  U base[N];
  F part[N];
  for (size_t i = 0; i < N; ++i) {
    const F x = bounded<F>(p[i]), low = floor(x);
    base[i] = U(to_int<F>(low));
    part[i] = x - low;
  }
  Worley<F> w{{F(1e6f), F(1e6f), F(1e6f)}, F(0.f)};
  F to_nearest[N];
  for (F& x : to_nearest) x = F(0.f);
  constexpr uint32_t kCells = N == 2 ? 9 : 27;
  for (uint32_t c = 0; c < kCells; ++c) {
    // Visit cells with the first axis varying slowest, as MaterialX does.
    const uint32_t digits[3] = {N == 2 ? c / 3 : c / 9, N == 2 ? c % 3 : c / 3 % 3, c % 3};
    U at[N + 1];
    for (size_t i = 0; i < N; ++i) at[i] = base[i] + U(digits[i]) - U(1u);
    F away[N], square(0.f);
    for (uint32_t i = 0; i < N; ++i) {
      at[N] = U(i);
      const F offset = fma(F(unit_of<F>(hash(at)) - 0.5f), jitter, F(0.5f));
      away[i] = F(static_cast<float>(digits[i]) - 1.f) + offset - part[i];
      square = fma(away[i], away[i], square);
    }
    const Mask<F> first = square < w.nearest[0];
    const Mask<F> second = square < w.nearest[1], third = square < w.nearest[2];
    w.nearest[2] = select(third, select(second, w.nearest[1], square), w.nearest[2]);
    w.nearest[1] = select(second, select(first, w.nearest[0], square), w.nearest[1]);
    w.nearest[0] = select(first, square, w.nearest[0]);
    for (size_t i = 0; i < N; ++i) to_nearest[i] = select(first, away[i], to_nearest[i]);
  }
  for (F& x : w.nearest) x = sqrt(x);
  F at[N];
  for (size_t i = 0; i < N; ++i) at[i] = to_nearest[i] + p[i];
  w.cell = cell<F>(at);
  return w;
}

}  // namespace wavecomb::noise
