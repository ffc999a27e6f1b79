// SPDX-License-Identifier: Apache-2.0
/// Directions as they are from the middle of a region, for its light is taken to lie on a sphere
/// about it.
///
/// A lamp or a door a few metres away is in another direction from each place of a region. With o
/// the place and y what it sees along w, both from the middle and in radii of the sphere,
///   y = o + s w,   |y| = 1,   s = c - o.w,   c = sqrt((o.w)^2 + 1 - |o|^2) = y.w,
/// y is the direction from the middle, and a density p over such directions is one of p s^2 / c
/// over w: the sphere's area is the solid angle from its middle, and c / s^2 of that from o.
/// Where |o| < 1 each w has one y and each y one w. (L. Ruppert, S. Herholz, H. P. A. Lensch,
/// "Robust Fitting of Parallax-Aware Mixtures for Path Guiding", SIGGRAPH 2020, move the means of
/// lobes so; for bins the whole map has to be one.)
#pragma once

#include "wavecomb/core/math.h"
#include "wavecomb/core/vec.h"

namespace wavecomb {

/// What a region's light is taken to lie on.
struct GuideSphere {
  float middle[3] = {};  ///< of the places in the region
  float nearness = 0;    ///< one over the radius; 0: all places see one thing in one direction
};

/// No place is farther from the middle, in radii.
inline constexpr float kMostOffset = 0.7f;

/// A place in a sphere: from its middle, in radii, and kMostOffset at most.
template <typename F>
inline Vec3<F> sphere_offset(const Vec3<F>& p, const Vec3<F>& middle, const F& nearness) {
  const auto along = [&](const F& x, const F& m) {
    return clamp(F((x - m) * nearness), F(-1.f), F(1.f));
  };
  const Vec3<F> o{along(p.x, middle.x), along(p.y, middle.y), along(p.z, middle.z)};
  constexpr float most = kMostOffset * kMostOffset;
  return o * safe_sqrt(F(most / max(dot(o, o), F(most))));
}

/// A direction from the middle, and by how much a density over such directions is larger where
/// they are seen from the place.
template <typename F>
struct FromMiddle {
  Vec3<F> w;
  F factor;
};

/// What the place at `offset` sees along the unit vector w.
template <typename F>
inline FromMiddle<F> seen_from_middle(const Vec3<F>& offset, const Vec3<F>& w) {
  const F along = dot(offset, w);
  const F c = safe_sqrt(F(fma(along, along, F(1.f)) - dot(offset, offset)));
  const F s = c - along;
  return {offset + w * s, s * s / c};
}

/// The unit vector along which the place at `offset` sees what lies along w from the middle.
template <typename F>
inline Vec3<F> seen_from_place(const Vec3<F>& offset, const Vec3<F>& w) {
  return normalize(w - offset);
}

}  // namespace wavecomb
