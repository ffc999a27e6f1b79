// SPDX-License-Identifier: Apache-2.0
/// Functions that map uniform samples of the unit square to directions and points on shapes, and
/// the densities of these mappings.
#pragma once

#include "wavecomb/core/math.h"
#include "wavecomb/core/vec.h"

namespace wavecomb {

/// Samples a uniform point on the unit disk with the concentric map (Shirley and Chiu, "A Low
/// Distortion Map Between Disk and Square", JGT 2(3) 1997).
template <typename F>
inline Vec2<F> square_to_disk(const F& u, const F& v) {
  const F a = fma(u, F(2.f), F(-1.f)), b = fma(v, F(2.f), F(-1.f));
  const Mask<F> wide = abs(a) > abs(b);
  const F r = select(wide, a, b);
  const F ratio = select(wide, b, a) / select(r == 0.f, F(1.f), r);
  // The angle phi / (2 pi) is ratio / 8 in the sectors where |a| > |b|, and 1/4 - ratio / 8 in the
  // other sectors.
  const F turn = select(wide, F(ratio * 0.125f), fma(ratio, F(-0.125f), F(0.25f)));
  const auto [s, c] = sincos_2pi(turn);
  return {r * c, r * s};
}

/// Samples a direction in the hemisphere around +z in proportion to its cosine. The density is
/// cos_theta / pi.
template <typename F>
WAVECOMB_INLINE Vec3<F> square_to_cosine_hemisphere(const F& u, const F& v) {
  const Vec2<F> d = square_to_disk(u, v);
  const F r2 = fma(d.x, d.x, F(d.y * d.y));
  return {d.x, d.y, safe_sqrt(F(1.f - r2))};
}
template <typename F>
inline F cosine_hemisphere_pdf(const F& cos_theta) {
  return max(cos_theta, F(0.f)) * kInvPi;
}

/// Samples a uniform direction on the sphere. The density is 1 / (4 pi).
template <typename F>
inline Vec3<F> square_to_sphere(const F& u, const F& v) {
  const F z = fma(u, F(-2.f), F(1.f));
  const F r = safe_sqrt(fnma(z, z, F(1.f)));
  const auto [s, c] = sincos_2pi(v);
  return {r * c, r * s, z};
}

/// Samples a uniform direction in a cone around +z. `one_minus_cos` is 1 - cos of the cone's half
/// angle. The density is 1 / (2 pi one_minus_cos).
template <typename F>
inline Vec3<F> square_to_cone(const F& u, const F& v, const F& one_minus_cos) {
  // 1 - cos theta, which is more accurate for small angles than cos theta
  const F h = u * one_minus_cos;
  const F r = safe_sqrt(F(h * (2.f - h)));
  const auto [s, c] = sincos_2pi(v);
  return {r * c, r * s, 1.f - h};
}

/// Samples a uniform point in a triangle and returns its barycentric coordinates (b1, b2) (Heitz,
/// "A Low-Distortion Map Between Triangle and Square", 2019). The density is 1 / area.
template <typename F>
inline Vec2<F> square_to_triangle(const F& u, const F& v) {
  const Mask<F> upper = v > u;
  const F a = u * 0.5f, b = v * 0.5f;
  return {select(upper, a, F(u - b)), select(upper, F(v - a), b)};
}

}  // namespace wavecomb
