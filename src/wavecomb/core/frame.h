// SPDX-License-Identifier: Apache-2.0
/// Orthonormal shading frames.
#pragma once

#include "wavecomb/core/vec.h"

namespace wavecomb {

/// Orthonormal basis (s, t, n). The z axis of local coordinates is n. The basis is right-handed
/// unless `make_frame` is called with handedness -1.
template <typename F>
struct Frame {
  Vec3<F> s, t, n;

  WAVECOMB_INLINE Vec3<F> to_local(const Vec3<F>& v) const {
    return {dot(v, s), dot(v, t), dot(v, n)};
  }
  WAVECOMB_INLINE Vec3<F> to_world(const Vec3<F>& v) const {
    return fma(s, v.x, fma(t, v.y, Vec3<F>(n * v.z)));
  }
};

/// Returns a frame around the unit vector `n`, without branches (Duff et al., "Building an
/// Orthonormal Basis, Revisited", JCGT 6(1) 2017).
template <typename F>
WAVECOMB_INLINE Frame<F> make_frame(const Vec3<F>& n) {
  const F sign = copysign(F(1.f), n.z);
  const F a = -1.f / (sign + n.z);
  const F b = n.x * n.y * a;
  return {{fma(F(sign * n.x * n.x), a, F(1.f)), sign * b, -sign * n.x},
          {b, fma(F(n.y * n.y), a, sign), -n.y},
          n};
}

/// Returns a frame around the unit vector `n` where s is `tangent` made orthogonal to n and t is
/// cross(n, s) times `handedness` (1 or -1). Falls back to make_frame(n) if the tangent is parallel
/// to n (within 1e-3), zero or not finite. This threshold is far above rounding errors, so s never
/// depends on rounding errors alone.
template <typename F>
inline Frame<F> make_frame(const Vec3<F>& n, const Vec3<F>& tangent, const F& handedness = F(1.f)) {
  const Vec3<F> s = fma(n, F(-dot(n, tangent)), tangent);
  const F len2 = length_squared(s);
  const Mask<F> valid = (len2 > 1e-6f * length_squared(tangent)) & (len2 > 0.f) & is_finite(len2);
  const Frame<F> other = make_frame(n);
  const Vec3<F> unit = s * F(1.f / sqrt(select(valid, len2, F(1.f))));
  const Vec3<F> sx = select<F>(valid, unit, other.s);
  return {sx, select<F>(valid, cross(n, sx) * handedness, other.t), n};
}

/// Cosines and sines of the spherical coordinates of a local direction `w`. The polar axis is n =
/// (0, 0, 1).
template <typename F>
inline F cos_theta(const Vec3<F>& w) {
  return w.z;
}
template <typename F>
inline F abs_cos_theta(const Vec3<F>& w) {
  return abs(w.z);
}
template <typename F>
inline Mask<F> same_hemisphere(const Vec3<F>& a, const Vec3<F>& b) {
  return F(a.z * b.z) > 0.f;
}

}  // namespace wavecomb
