// SPDX-License-Identifier: Apache-2.0
/// Equal-area map between directions and the unit square: equal bins of the square cover equal
/// solid angles.
///
/// P. Clarberg, "Fast Equal-Area Mapping of the (Hemi)Sphere using SIMD", JGT 13(3) 2008. The
/// square is a folded octahedron. With a = 2u - 1, b = 2v - 1, d = 1 - |a| - |b|, r = 1 - |d|:
///   z = sign(d) (1 - r^2),   phi = (pi / 4) ((|b| - |a|) / r + 1),
///   x = sign(a) r sqrt(2 - r^2) cos(phi),   y = sign(b) r sqrt(2 - r^2) sin(phi).
#pragma once

#include "wavecomb/core/math.h"
#include "wavecomb/core/vec.h"

namespace wavecomb {

/// Maps the point (u, v) of the unit square to a unit vector.
template <typename F>
inline Vec3<F> octahedral_direction(const F& u, const F& v) {
  const F a = fma(u, F(2.f), F(-1.f)), b = fma(v, F(2.f), F(-1.f));
  const F d = F(1.f) - abs(a) - abs(b);
  const F r = F(1.f) - abs(d);
  const F ratio = (abs(b) - abs(a)) / select(r > 0.f, r, F(1.f));
  const auto [s, c] = sincos_2pi(fma(ratio, F(0.125f), F(0.125f)));
  const F r2 = r * r;
  const F sin_theta = r * safe_sqrt(F(2.f - r2));
  return {copysign(F(sin_theta * abs(c)), a), copysign(F(sin_theta * abs(s)), b),
          copysign(F(1.f - r2), d)};
}

/// Maps a unit vector to the unit square [0, 1]^2: the inverse of octahedral_direction.
template <typename F>
inline Vec2<F> octahedral_point(const Vec3<F>& w) {
  const F r = safe_sqrt(F(1.f - abs(w.z)));
  // angle phi within its quadrant, divided by pi / 2, in [0, 1]
  const F turn = atan2(abs(w.y), abs(w.x)) * (2.f * kInvPi);
  F b = turn * r, a = r - b;
  const Mask<F> below = w.z < 0.f;
  const F folded_a = F(1.f) - b, folded_b = F(1.f) - a;
  a = select(below, folded_a, a);
  b = select(below, folded_b, b);
  return {fma(copysign(a, w.x), F(0.5f), F(0.5f)), fma(copysign(b, w.y), F(0.5f), F(0.5f))};
}

}  // namespace wavecomb
