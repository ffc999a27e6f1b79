// SPDX-License-Identifier: Apache-2.0
/// UsdLuxShadowAPI: shadows with a limited distance, and coloured shadows.
///
/// For a shadow distance D and a falloff length f, an occluder at distance t casts a shadow of
/// strength s(t) = ((D - t) / f)^gamma if t is between D - f and D, 1 if t is less, and 0 if t is
/// greater. Shadow rays end at L = D - f u^(1 / gamma) with u uniform in [0, 1), so that P(L > t) =
/// s(t), and the expected shadow has the strength s(t).
///
/// Bounces that hit a light cannot reproduce such shadows. The light of lights with shadow
/// attributes is therefore found only by light samples.
#pragma once

#include "wavecomb/light/records/record_reader.h"

namespace wavecomb {

/// Length of a light's shadow rays, and fraction of the light that reaches shadowed points.
template <typename F>
struct ShadowExtent {
  F distance;
  Color<F> color;
};

/// Returns the shadow extent for shadow record `shadow`. For kPlainShadow, the distance is
/// unlimited, and shadows are black.
template <typename F>
[[gnu::noinline]] ShadowExtent<F> shadow_extent(const LightView& view, const UInt<F>& shadow,
                                                const F& u, const Mask<F>& active) {
  const Mask<F> known = active & Mask<F>(shadow != UInt<F>(kPlainShadow));
  ShadowExtent<F> extent{F(kFarAway), Color<F>(F(0.f))};
  if (none(known)) return extent;
  using R = ShadowRecord;
  const auto record = detail::make_reader<R, F>(view.shadows, shadow, known);
  const F falloff = record[&R::falloff];
  const F x = select(u > 0.f, pow(max(u, F(1e-30f)), record[&R::inverse_gamma]), F(0.f));
  const F end = record[&R::distance] - select(falloff > 0.f, F(falloff * x), F(0.f));
  extent.distance = select(known, max(end, F(0.f)), extent.distance);
  extent.color = select<F>(known, Color<F>(record[&R::color]), extent.color);
  return extent;
}

}  // namespace wavecomb
