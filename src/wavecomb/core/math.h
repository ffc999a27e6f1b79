// SPDX-License-Identifier: Apache-2.0
/// Elementary functions that give the same bits for floats and packets of floats.
///
/// Range reductions and minimax polynomials follow S. Moshier, Cephes Mathematical Library (single
/// precision). Tests against double precision show errors of a few ulp over the range of each
/// function.
///
/// Functions that also exist in Dr.Jit have the same template parameters as in Dr.Jit (hence `bool
/// = true`) and a constraint, so that the compiler prefers them to Dr.Jit's functions.
#pragma once

#include "wavecomb/core/lanes/lanes.h"

namespace wavecomb {

inline constexpr float kPi = 3.14159265358979323846f;
inline constexpr float kInvPi = 0.31830988618379067154f;
inline constexpr float kInv2Pi = 0.15915494309189533577f;
inline constexpr float kInv4Pi = 0.07957747154594766788f;
inline constexpr float kOneMinusEpsilon = 0x1.fffffep-1f;
inline constexpr float kInfinity = __builtin_inff();

/// Sine and cosine of 2 pi x, for |x| < 2^20.
template <typename F>
struct SinCos {
  F sin, cos;
};
template <LaneValue F>
inline SinCos<F> sincos_2pi(const F& x) {
  const F turns = x * 4.f;
  const F quadrant = floor(F(turns + 0.5f));
  const F r = (turns - quadrant) * (0.5f * kPi);  // in [-pi/4, pi/4]
  const UInt<F> q = UInt<F>(to_int<F>(quadrant)) & 3u;
  const F r2 = r * r;
  F s = fma(r2, F(-1.9515295891e-4f), F(8.3321608736e-3f));
  s = fma(s, r2, F(-1.6666654611e-1f));
  s = fma(F(s * r2), r, r);
  F c = fma(r2, F(2.443315711809948e-5f), F(-1.388731625493765e-3f));
  c = fma(c, r2, F(4.166664568298827e-2f));
  c = fma(F(c * r2), r2, fma(r2, F(-0.5f), F(1.f)));
  const Mask<F> swap = Mask<F>((q & 1u) == UInt<F>(1u));
  const F sin_abs = select(swap, c, s);
  const F cos_abs = select(swap, s, c);
  // Sign bits of the results: the sine is negative in the quadrants 2 and 3, and the cosine in the
  // quadrants 1 and 2.
  const UInt<F> sin_sign = (q & 2u) << 30;
  const UInt<F> cos_sign = ((q + 1u) & 2u) << 30;
  return {bits_float<F>(float_bits<F>(sin_abs) ^ sin_sign),
          bits_float<F>(float_bits<F>(cos_abs) ^ cos_sign)};
}

/// Returns the arc tangent of y / x over the whole circle, in [-pi, pi]. Returns 0 if x and y are
/// 0. |x| + |y| must be finite.
template <LaneValue F>
inline F atan2(const F& y, const F& x) {
  const F ax = abs(x), ay = abs(y);
  const F hi = max(ax, ay), lo = min(ax, ay);
  // Argument of the polynomial: t = lo / hi, or (t - 1) / (t + 1) if t is above tan(pi / 8).
  const Mask<F> reduce = lo > F(hi * 0.4142135623730950f);
  const F over = select(reduce, F(lo - hi), lo), under = select(reduce, F(lo + hi), hi);
  const F r = over / select(hi > 0.f, under, F(1.f));
  const F z = r * r;
  F p = fma(z, F(8.05374449538e-2f), F(-1.38776856032e-1f));
  p = fma(p, z, F(1.99777106478e-1f));
  p = fma(p, z, F(-3.33329491539e-1f));
  F a = fma(F(p * z), r, r) + select(reduce, F(0.25f * kPi), F(0.f));
  a = select(ay > ax, F(0.5f * kPi - a), a);
  a = select(x < 0.f, F(kPi - a), a);
  return copysign(a, y);
}

/// Returns the arc cosine of x clamped to [-1, 1].
template <LaneValue F, bool = true>
inline F acos(const F& x) {
  const F c = clamp(x, F(-1.f), F(1.f));
  return atan2(safe_sqrt(F((1.f - c) * (1.f + c))), c);
}

/// Returns e^x, or 0 if x is below -87.3. Values of x above 88 are treated as 88.
template <LaneValue F, bool = true>
inline F exp(const F& x) {
  const F c = clamp(x, F(-88.f), F(88.f));
  const F n = floor(fma(c, F(1.44269504088896341f), F(0.5f)));
  F r = fma(n, F(-0.693359375f), c);
  r = fma(n, F(2.12194440e-4f), r);
  F p = fma(r, F(1.9875691500e-4f), F(1.3981999507e-3f));
  p = fma(p, r, F(8.3334519073e-3f));
  p = fma(p, r, F(4.1665795894e-2f));
  p = fma(p, r, F(1.6666665459e-1f));
  p = fma(p, r, F(5.0000001201e-1f));
  const F y = fma(F(p * r), r, F(r + 1.f));
  const UInt<F> exponent = UInt<F>(to_int<F>(n) + 127) << 23;
  return select(x < -87.3f, F(0.f), F(y * bits_float<F>(exponent)));
}

/// Returns the natural logarithm of x, which must be positive and normal.
template <LaneValue F, bool = true>
inline F log(const F& x) {
  const UInt<F> bits = float_bits<F>(x);
  F e = F(Int<F>(bits >> 23) - 126);
  F m = bits_float<F>((bits & 0x007fffffu) | 0x3f000000u);  // [0.5, 1)
  const Mask<F> small = m < 0.707106781186547524f;
  e = select(small, F(e - 1.f), e);
  m = select(small, F(m + m), m) - 1.f;
  const F z = m * m;
  F p = fma(m, F(7.0376836292e-2f), F(-1.1514610310e-1f));
  p = fma(p, m, F(1.1676998740e-1f));
  p = fma(p, m, F(-1.2420140846e-1f));
  p = fma(p, m, F(1.4249322787e-1f));
  p = fma(p, m, F(-1.6668057665e-1f));
  p = fma(p, m, F(2.0000714765e-1f));
  p = fma(p, m, F(-2.4999993993e-1f));
  p = fma(p, m, F(3.3333331174e-1f));
  F y = p * m * z;
  y = fma(e, F(-2.12194440e-4f), y);
  y = fma(z, F(-0.5f), y);
  return fma(e, F(0.693359375f), F(m + y));
}

/// Returns the base-2 logarithm of x, which must be positive and normal.
template <LaneValue F, bool = true>
inline F log2(const F& x) {
  return log(x) * 1.44269504088896341f;
}

/// Returns x^y, where x must not be negative. Returns 0 if x is 0 or denormal and y is positive.
template <LaneValue F>
inline F pow(const F& x, const F& y) {
  return select(x < 1.17549435e-38f, F(0.f), exp(F(y * log(max(x, F(1.17549435e-38f))))));
}

}  // namespace wavecomb
