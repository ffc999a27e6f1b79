// SPDX-License-Identifier: Apache-2.0
/// UsdLuxShadowAPI: shadows with a limited distance, and coloured shadows.
///
/// A shadow whose nearest occluder is at distance t has the strength s(t) = ((D - t) / f)^gamma
/// from D - f to D, 1 before and 0 beyond. Shadow rays end at L = D - f u^(1 / gamma), u uniform in
/// [0, 1), so that P(L > t) = s(t). The mean of these random shadow rays is that shadow.
///
/// Emission that a bounce hits cannot reproduce this, so only light samples find such lights.
#pragma once

#include "wavecomb/light/records/record_reader.h"

namespace wavecomb {

/// Length of a light's shadow rays, and the fraction of its light that remains in its shadows.
template <typename F>
struct ShadowExtent {
  F distance;
  Color<F> color;
};

/// Returns the extent of the shadows of shadow record `shadow`. With kPlainShadow the extent is
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
