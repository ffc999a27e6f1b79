// SPDX-License-Identifier: Apache-2.0
/// Arithmetic of vectors and colours over lane types.
#pragma once

#include "wavecomb/core/affine.h"
#include "wavecomb/core/lanes/lanes.h"
#include "wavecomb/core/vec3.h"

namespace wavecomb {

template <typename F>
WAVECOMB_INLINE F dot(const Vec3<F>& a, const Vec3<F>& b) {
  return fma(a.z, b.z, fma(a.y, b.y, F(a.x * b.x)));
}
template <typename F>
WAVECOMB_INLINE F length_squared(const Vec3<F>& a) {
  return dot(a, a);
}
template <typename F>
WAVECOMB_INLINE F length(const Vec3<F>& a) {
  return sqrt(dot(a, a));
}
template <typename F>
WAVECOMB_INLINE Vec3<F> cross(const Vec3<F>& a, const Vec3<F>& b) {
  return {fma(a.y, b.z, F(-(a.z * b.y))), fma(a.z, b.x, F(-(a.x * b.z))),
          fma(a.x, b.y, F(-(a.y * b.x)))};
}
/// Returns a / |a|. The result for the zero vector is NaN.
template <typename F>
WAVECOMB_INLINE Vec3<F> normalize(const Vec3<F>& a) {
  return a * F(1.f / length(a));
}
/// Returns a + s b.
template <typename F>
WAVECOMB_INLINE Vec3<F> fma(const Vec3<F>& b, const F& s, const Vec3<F>& a) {
  return {fma(b.x, s, a.x), fma(b.y, s, a.y), fma(b.z, s, a.z)};
}
template <typename F>
WAVECOMB_INLINE Vec3<F> lerp(const Vec3<F>& a, const Vec3<F>& b, const F& t) {
  return fma(Vec3<F>(b - a), t, a);
}
template <typename F>
WAVECOMB_INLINE Vec3<F> select(const Mask<F>& m, const Vec3<F>& a, const Vec3<F>& b) {
  return {select(m, a.x, b.x), select(m, a.y, b.y), select(m, a.z, b.z)};
}
template <typename F>
WAVECOMB_INLINE Vec3<F> min(const Vec3<F>& a, const Vec3<F>& b) {
  return {min(a.x, b.x), min(a.y, b.y), min(a.z, b.z)};
}
template <typename F>
WAVECOMB_INLINE Vec3<F> max(const Vec3<F>& a, const Vec3<F>& b) {
  return {max(a.x, b.x), max(a.y, b.y), max(a.z, b.z)};
}
template <typename F>
WAVECOMB_INLINE F max_component(const Vec3<F>& a) {
  return max(max(a.x, a.y), a.z);
}
/// Returns the Rec.709 luminance of a linear colour.
template <typename F>
WAVECOMB_INLINE F luminance(const Vec3<F>& c) {
  return fma(c.z, F(0.072186f), fma(c.y, F(0.715158f), F(c.x * 0.212656f)));
}
template <typename F>
WAVECOMB_INLINE Mask<F> is_black(const Vec3<F>& c) {
  return (c.x == 0.f) & (c.y == 0.f) & (c.z == 0.f);
}

/// Loads a vector in each lane, from the three consecutive floats of an array that start at 3 *
/// `index`.
template <typename F>
inline Vec3<F> gather_vec3(const float* base, const UInt<F>& index, const Mask<F>& active) {
  const UInt<F> i = index * 3u;
  return {gather<F>(base, i, active), gather<F>(base, i + 1u, active),
          gather<F>(base, i + 2u, active)};
}

}  // namespace wavecomb
