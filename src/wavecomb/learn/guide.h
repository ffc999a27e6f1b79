// SPDX-License-Identifier: Apache-2.0
/// Looking up and sampling the field that guides bounces. Bodies are in guide.inl.
///
/// A bounce is sampled by the BSDF with probability a and by the field with 1 - a, and whichever
/// gave a direction, its density is that of the mixture:
///   p(wi) = a p_bsdf(wi) + (1 - a) p_guide(wi)
/// (one-sample model with the balance heuristic, Veach 1997, 9.2.4; path guiding: Vorba et al.
/// 2014, Mueller et al. 2017). p_guide is constant in each of 1,024 bins of equal solid angle, of
/// directions from the middle of a region (guide_sphere.h).
#pragma once

#include "wavecomb/core/lanes.h"
#include "wavecomb/learn/directions.h"
#include "wavecomb/learn/guide_view.h"

namespace wavecomb {

/// Where a vertex is in the field.
template <typename F>
struct GuidePlace {
  UInt<F> axis{0u};  ///< which way its surface faces: of kGuideAxes
  UInt<F> region{kNoGuideRegion};
  Vec3<F> offset{F(0.f), F(0.f), F(0.f)};  ///< in the region's sphere
  F bsdf_share{1.f};                       ///< a; 1: not guided
  F survival{0.f};                         ///< GuideView::survival
  Mask<F> known{false};                    ///< lanes with a region
  Mask<F> guided{false};                   ///< lanes with a < 1
};

/// Which way `n` faces most: 2 i, or 2 i + 1 where component i is below 0.
template <typename F>
inline UInt<F> guide_axis(const Vec3<F>& n) {
  using U = UInt<F>;
  const F x = abs(n.x), y = abs(n.y), z = abs(n.z);
  const Mask<F> by_x = (x >= y) & (x >= z), by_y = y >= z;
  const F along = select(by_x, n.x, select(by_y, n.y, n.z));
  const U axis = select(Mask<U>(by_x), U(0u), select(Mask<U>(by_y), U(2u), U(4u)));
  return axis + select(Mask<U>(along < 0.f), U(1u), U(0u));
}

/// The place of a surface at p that faces `axis` on the side that it is seen from.
template <typename F>
[[gnu::noinline]] GuidePlace<F> find_guide(const GuideView& guide, const Vec3<F>& p,
                                           const UInt<F>& axis, const UInt<F>& material,
                                           const Mask<F>& active);

/// Density over solid angle with which sample_guide gives the world's unit vector w.
template <typename F>
[[gnu::noinline]] F guide_pdf(const GuideView& guide, const GuidePlace<F>& place, const Vec3<F>& w,
                              const Mask<F>& active);

/// A direction by the field, in world space, for two numbers in [0, 1).
template <typename F>
[[gnu::noinline]] Vec3<F> sample_guide(const GuideView& guide, const GuidePlace<F>& place,
                                       const F& u, const F& v, const Mask<F>& active);

/// One over the brightness of the picture at pixel (x, y); 0: not known.
template <typename F>
inline F picture_importance(const GuideView& guide, const F& x, const F& y, const Mask<F>& active) {
  using U = UInt<F>;
  if (!guide.tiles) return F(0.f);
  const U column = U(to_int<F>(F((x + 0.5f) * guide.tiles_of_x)));
  const U row = U(to_int<F>(F((y + 0.5f) * guide.tiles_of_y)));
  return gather<F>(guide.tiles, row * guide.tile_rows + column, active);
}

}  // namespace wavecomb
