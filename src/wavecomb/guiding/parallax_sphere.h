// SPDX-License-Identifier: Apache-2.0
/// Parallax compensation: directions of incident light relative to the centre of a region.
///
/// A light or a door a few metres away lies in a different direction from each point of a region.
/// The incident light is therefore assumed to lie on a sphere around the region's centre. With o
/// the shading point and y the point seen along w, both relative to the centre and in units of the
/// radius:
///   y = o + s w,   |y| = 1,   s = c - o.w,   c = sqrt((o.w)^2 + 1 - |o|^2) = y.w,
/// where y is also the direction from the centre. A density p over y is the density p s^2 / c over
/// w, since an area element dA of the unit sphere subtends the solid angle dA from the centre and
/// (c / s^2) dA from o. For |o| < 1 the map from w to y is one-to-one.
///
/// L. Ruppert, S. Herholz, H. P. A. Lensch, "Robust Fitting of Parallax-Aware Mixtures for Path
/// Guiding", SIGGRAPH 2020, move only the means of lobes in this way. A distribution in bins needs
/// the map for all directions.
#pragma once

#include "wavecomb/core/math.h"
#include "wavecomb/core/vec.h"

namespace wavecomb {

/// Sphere on which the incident light of a region is assumed to lie.
struct ParallaxSphere {
  float centre[3] = {};        ///< mean position of the region's training bounces
  float inverse_distance = 0;  ///< one over the sphere's radius; 0 means no parallax compensation
};

/// Maximum distance of a shading point from the centre, in radii.
inline constexpr float kMaxOffset = 0.7f;

/// Returns the position of a shading point relative to the centre of the sphere, in radii, clamped
/// to length kMaxOffset.
template <typename F>
inline Vec3<F> sphere_offset(const Vec3<F>& p, const Vec3<F>& centre, const F& inverse_distance) {
  const auto along = [&](const F& x, const F& m) {
    return clamp(F((x - m) * inverse_distance), F(-1.f), F(1.f));
  };
  const Vec3<F> o{along(p.x, centre.x), along(p.y, centre.y), along(p.z, centre.z)};
  constexpr float most = kMaxOffset * kMaxOffset;
  return o * safe_sqrt(F(most / max(dot(o, o), F(most))));
}

/// Direction from the centre of the sphere, and the factor that converts a density over such
/// directions to a density over directions from the shading point.
template <typename F>
struct CentreDirection {
  Vec3<F> w;
  F factor;
};

/// Maps the direction w, as seen from the shading point at `offset`, to the direction as seen from
/// the centre.
template <typename F>
inline CentreDirection<F> direction_from_centre(const Vec3<F>& offset, const Vec3<F>& w) {
  const F along = dot(offset, w);
  const F c = safe_sqrt(F(fma(along, along, F(1.f)) - dot(offset, offset)));
  const F s = c - along;
  return {offset + w * s, s * s / c};
}

/// Maps the direction w, as seen from the centre, to the direction as seen from the shading point
/// at `offset`. The function is the inverse of direction_from_centre.
template <typename F>
inline Vec3<F> direction_from_point(const Vec3<F>& offset, const Vec3<F>& w) {
  return normalize(w - offset);
}

}  // namespace wavecomb
