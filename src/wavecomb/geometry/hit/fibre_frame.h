// SPDX-License-Identifier: Apache-2.0
/// Shading frame of a hair fibre at a hit.
#pragma once

#include "wavecomb/core/frame.h"
#include "wavecomb/geometry/hit/surface.h"

namespace wavecomb {

namespace detail {

/// Returns the normal of the round fibre that a ribbon represents. The offset from the fibre axis
/// is h = 2 v - 1 in half widths, for any orientation of the ribbon. The normal is n = sqrt(1 -
/// h^2) w + h e, where w is the direction opposite to the ray, made perpendicular to the fibre, and
/// e the ribbon's width direction, made perpendicular to the fibre and w.
template <typename F>
inline Vec3<F> ribbon_fibre_normal(const Surface<F>& s, const Vec3<F>& dir, const F& v) {
  const F len2 = length_squared(s.dpdu);
  const Vec3<F> along = s.dpdu * F(1.f / sqrt(select(len2 > 0.f, len2, F(1.f))));
  const Vec3<F> across = cross(along, s.ng) * s.handedness;
  const Vec3<F> back = fma(along, dot(along, dir), -dir);
  const F back2 = length_squared(back);
  const Mask<F> off_axis = back2 > 1e-12f;
  const Vec3<F> w =
      select<F>(off_axis, back * F(1.f / sqrt(select(off_axis, back2, F(1.f)))), s.ng);
  const F h = clamp(fma(v, F(2.f), F(-1.f)), F(-1.f), F(1.f));
  return fma(make_frame<F>(w, across).s, h, w * safe_sqrt(F(1.f - h * h)));
}

}  // namespace detail

/// Returns the frame of a fibre: x along the fibre, z along its normal. The frame is exact on
/// tubes; other meshes are treated as tubes along the u direction of their texture coordinates.
/// `s.dpdu` must be set.
template <typename F>
[[gnu::noinline]] Frame<F> fibre_frame(const SceneView& scene, const MeshHit<F>& hit,
                                       const Surface<F>& s, const Vec3<F>& dir,
                                       const Mask<F>& active) {
  Vec3<F> n = s.ns;
  if (scene.has_curves) {
    const UInt<F> flags = gather_member<F>(scene.meshes, &MeshRecord::flags, hit.mesh, active);
    const Mask<F> ribbons = active & Mask<F>((flags & uint32_t{kIsRibbon}) != UInt<F>(0u));
    if (any(ribbons)) n = select<F>(ribbons, detail::ribbon_fibre_normal<F>(s, dir, hit.v), n);
  }
  return make_frame<F>(n, s.dpdu);
}

}  // namespace wavecomb
