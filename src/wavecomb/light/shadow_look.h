// SPDX-License-Identifier: Apache-2.0
/// UsdLuxShadowAPI: shadows that end at a distance, and that are not black.
///
/// A shadow whose nearest occluder is at t is as strong as s(t) = ((D - t) / f)^gamma from D - f to
/// D, 1 before and 0 beyond. Shadow rays end at
///   L = D - f u^(1 / gamma),   u uniform in [0, 1),
/// so that P(L > t) = s(t): what they find is that shadow, in the mean.
///
/// A bounce that meets the light knows nothing of this; so light samples alone find such lights.
#pragma once

#include "wavecomb/light/record.h"

namespace wavecomb {

/// How far a light's shadow rays go, and what of its light arrives in its shadows.
template <typename F>
struct ShadowReach {
  F distance;
  Color<F> color;
};

/// Of the light whose record says `look` (kPlainShadow: as far as the light, and black).
template <typename F>
[[gnu::noinline]] ShadowReach<F> shadow_reach(const LightView& view, const UInt<F>& look,
                                              const F& u, const Mask<F>& active) {
  const Mask<F> known = active & Mask<F>(look != UInt<F>(kPlainShadow));
  ShadowReach<F> reach{F(kFarAway), Color<F>(F(0.f))};
  if (none(known)) return reach;
  using R = ShadowLookRecord;
  const auto record = detail::make_reader<R, F>(view.shadows, look, known);
  const F falloff = record[&R::falloff];
  const F x = select(u > 0.f, pow(max(u, F(1e-30f)), record[&R::inverse_gamma]), F(0.f));
  const F end = record[&R::distance] - select(falloff > 0.f, F(falloff * x), F(0.f));
  reach.distance = select(known, max(end, F(0.f)), reach.distance);
  reach.color = select<F>(known, Color<F>(record[&R::color]), reach.color);
  return reach;
}

}  // namespace wavecomb
