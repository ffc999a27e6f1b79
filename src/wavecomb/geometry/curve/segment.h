// SPDX-License-Identifier: Apache-2.0
/// Parametrisation of curves and points. Ray traversal computes the coordinates (u, v) of a hit,
/// from which shading reconstructs the surface point.
///
/// A tube is the union of spheres of radius r(u) around the points c(u) of its curve. A unit normal
/// n of the tube's lateral surface satisfies n . c' = -r', since |p - c|^2 - r^2 is stationary in u
/// at surface points p. The ends of the tube are parts of the first and the last sphere. The
/// coordinate u of a hit is the parameter of the sphere on which it lies, and v is the angle around
/// the curve in turns. On the spherical ends, u is below 0 or above 1 by the angle in radians
/// between the normal and the nearest normal of the lateral surface.
///
/// A ribbon consists of the points c(u) + s r(u) b(u) with |s| <= 1, where n is the authored normal
/// and b the unit vector in the direction of c' x n. The coordinates of a hit are u and v = (s + 1)
/// / 2.
///
/// The coordinates of a hit on a point's sphere are u = phi / (2 pi), where phi is the angle around
/// the z axis, and v = theta / pi, where theta is the angle from +z.
#pragma once

#include <array>

#include "wavecomb/core/frame.h"
#include "wavecomb/core/math.h"
#include "wavecomb/geometry/mesh/mesh.h"

namespace wavecomb {

/// Curve segment with four Bezier control points, or with the end points of a line as points 0 and
/// 1.
template <typename F>
struct CurveSegment {
  std::array<Vec3<F>, 4> p;
  std::array<F, 4> r;        ///< radii
  std::array<Vec3<F>, 4> n;  ///< normals, for ribbons
  Mask<F> cubic;  ///< mask of the lanes with cubic segments; the segments in other lanes are lines
};

/// Point `c` and radius `r` of a curve at a parameter, and their derivatives.
template <typename F>
struct CurvePoint {
  Vec3<F> c, dc;
  F r, dr;
};

namespace detail {

/// Weights of the control points at a parameter u, and weights of their differences for the
/// derivative.
template <typename F>
struct CurveWeights {
  std::array<F, 4> value;
  std::array<F, 3> slope;

  CurveWeights(const F& u, const Mask<F>& cubic) {
    const F w = 1.f - u, ww = w * w, uu = u * u;
    value = {select(cubic, F(ww * w), w), select(cubic, F(3.f * ww * u), u),
             select(cubic, F(3.f * w * uu), F(0.f)), select(cubic, F(uu * u), F(0.f))};
    slope = {select(cubic, F(3.f * ww), F(1.f)), select(cubic, F(6.f * w * u), F(0.f)),
             select(cubic, F(3.f * uu), F(0.f))};
  }
  template <typename T>
  T at(const std::array<T, 4>& x) const {
    return x[0] * value[0] + x[1] * value[1] + x[2] * value[2] + x[3] * value[3];
  }
  /// Returns the derivative at u. The derivative is computed from differences of control points, so
  /// that it is precise even if control points are close together.
  template <typename T>
  T along(const std::array<T, 4>& x) const {
    return (x[1] - x[0]) * slope[0] + (x[2] - x[1]) * slope[1] + (x[3] - x[2]) * slope[2];
  }
};

}  // namespace detail

/// Evaluates a curve at u in [0, 1].
template <typename F>
inline CurvePoint<F> curve_point(const CurveSegment<F>& s, const F& u) {
  const detail::CurveWeights<F> weights(u, s.cubic);
  return {weights.at(s.p), weights.along(s.p), weights.at(s.r), weights.along(s.r)};
}

/// Frame of a tube at a parameter u with z along the curve, and the angle between z and the normals
/// of the lateral surface.
template <typename F>
struct TubeFrame {
  Frame<F> frame;
  F cos_side, sin_side;
};

/// Returns the frame of a tube at a parameter u. If the derivative is zero because control points
/// coincide, the direction of the curve is computed from the next control points.
template <typename F>
inline TubeFrame<F> tube_frame(const CurveSegment<F>& s, const CurvePoint<F>& at) {
  Vec3<F> d = at.dc;
  F dr = at.dr, len2 = length_squared(d);
  const Mask<F> flat = not_(Mask<F>(len2 > 0.f));
  const auto instead = [&](const Vec3<F>& other, const F& slope) {
    const Mask<F> use = not_(Mask<F>(len2 > 0.f));
    d = select<F>(use, other, d);
    dr = select(use, slope, dr);
    len2 = length_squared(d);
  };
  if (any(flat)) {
    instead(s.p[2] - s.p[1], s.r[2] - s.r[1]);
    instead(s.p[3] - s.p[0], s.r[3] - s.r[0]);
    instead({F(1.f), F(0.f), F(0.f)}, F(0.f));
  }
  const F inverse = 1.f / sqrt(len2);
  const F cos_side = clamp(F(-dr * inverse), F(-1.f), F(1.f));
  return {make_frame<F>(d * inverse), cos_side, safe_sqrt(F((1.f - cos_side) * (1.f + cos_side)))};
}

/// Returns the outward normal of a tube at a hit.
template <typename F>
inline Vec3<F> tube_normal(const TubeFrame<F>& tube, const F& u, const F& v) {
  F c = tube.cos_side, s = tube.sin_side;
  const Mask<F> at_end = (u < 0.f) | (u > 1.f);
  if (any(at_end)) {
    const F beyond = select(u < 0.f, F(-u), F(1.f - u));
    const SinCos<F> theta = sincos_2pi(F((atan2(s, c) + beyond) * kInv2Pi));
    c = select(at_end, theta.cos, c);
    s = select(at_end, theta.sin, s);
  }
  const SinCos<F> phi = sincos_2pi(v);
  return tube.frame.to_world({s * phi.cos, s * phi.sin, c});
}

/// Returns the direction from a sphere's centre to a hit.
template <typename F>
inline Vec3<F> sphere_normal(const F& u, const F& v) {
  const SinCos<F> phi = sincos_2pi(u), theta = sincos_2pi(F(0.5f * v));
  return {theta.sin * phi.cos, theta.sin * phi.sin, theta.cos};
}

/// Bit masks for the values in `Mesh::indices` of a mesh of curves: the index of a segment's first
/// control point, and flags that state whether the curve continues before and after the segment. If
/// the curve continues, the adjacent control point gives its direction there.
inline constexpr uint32_t kCurveContinuesBefore = 0x80000000u, kCurveContinuesAfter = 0x40000000u;
inline constexpr uint32_t kCurveFirstPoint = 0x3fffffffu;

}  // namespace wavecomb
