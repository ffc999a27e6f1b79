// SPDX-License-Identifier: Apache-2.0
/// Lookup and sampling of the guiding field. The definitions are in lookup.inl.
///
/// The BSDF samples a bounce with probability a, the guiding field with 1 - a. Whichever of the two
/// samples the direction, its density is the density of the mixture:
///   p(wi) = a p_bsdf(wi) + (1 - a) p_guide(wi)
/// (one-sample model with the balance heuristic, Veach 1997, 9.2.4; path guiding: Vorba et al.
/// 2014, Mueller et al. 2017). p_guide is constant in each of kGuidingBins bins of equal solid
/// angle. The bins are directions from the centre of a region (parallax_sphere.h).
#pragma once

#include "wavecomb/core/lanes/lanes.h"
#include "wavecomb/guiding/directions.h"
#include "wavecomb/guiding/field/field_view.h"

namespace wavecomb {

/// Result of a lookup: the region of a vertex in the guiding field.
template <typename F>
struct GuidingLookup {
  UInt<F> axis{0u};  ///< axis direction that the surface faces; see guiding_axis()
  UInt<F> region{kNoGuidingRegion};
  /// Position relative to the region's sphere; see sphere_offset()
  Vec3<F> offset{F(0.f), F(0.f), F(0.f)};
  /// Probability a that the BSDF samples the bounce; 1 means that the bounce is not guided.
  F bsdf_share{1.f};
  F survival{0.f};        ///< GuidingView::survival
  Mask<F> known{false};   ///< lanes with a region
  Mask<F> guided{false};  ///< lanes with a < 1
};

/// Returns the axis direction closest to `n`: 2 i, or 2 i + 1 if component i is negative.
template <typename F>
inline UInt<F> guiding_axis(const Vec3<F>& n) {
  using U = UInt<F>;
  const F x = abs(n.x), y = abs(n.y), z = abs(n.z);
  const Mask<F> by_x = (x >= y) & (x >= z), by_y = y >= z;
  const F along = select(by_x, n.x, select(by_y, n.y, n.z));
  const U axis = select(Mask<U>(by_x), U(0u), select(Mask<U>(by_y), U(2u), U(4u)));
  return axis + select(Mask<U>(along < 0.f), U(1u), U(0u));
}

/// Finds the region of a shading point at p. `axis` is the guiding_axis of the normal on the
/// viewer's side. The region is kNoGuidingRegion where the field has no training samples.
template <typename F>
[[gnu::noinline]] GuidingLookup<F> look_up_guiding(const GuidingView& guide, const Vec3<F>& p,
                                                   const UInt<F>& axis, const UInt<F>& material,
                                                   const Mask<F>& active);

/// Returns the density per solid angle with which sample_guiding() samples the world-space unit
/// vector w.
template <typename F>
[[gnu::noinline]] F guiding_pdf(const GuidingView& guide, const GuidingLookup<F>& guiding,
                                const Vec3<F>& w, const Mask<F>& active);

/// Samples a direction in world space from the region's distribution; u and v are in [0, 1).
template <typename F>
[[gnu::noinline]] Vec3<F> sample_guiding(const GuidingView& guide, const GuidingLookup<F>& guiding,
                                         const F& u, const F& v, const Mask<F>& active);

/// Returns one over the brightness of the image around pixel (x, y), or 0 if the brightness is not
/// known.
template <typename F>
inline F pixel_importance(const GuidingView& guide, const F& x, const F& y, const Mask<F>& active) {
  using U = UInt<F>;
  if (!guide.tiles) return F(0.f);
  const U column = U(to_int<F>(F((x + 0.5f) * guide.tiles_of_x)));
  const U row = U(to_int<F>(F((y + 0.5f) * guide.tiles_of_y)));
  return gather<F>(guide.tiles, row * guide.tile_rows + column, active);
}

}  // namespace wavecomb
