// SPDX-License-Identifier: Apache-2.0
/// Notes for light path expressions how a vertex scatters. Run only where they are asked for.
///
/// A BSDF is a sum of lobes, of which a direction says nothing. What a scattering counts as is
/// therefore split by colour: the share f_diffuse / f is diffuse, the rest glossy.
#pragma once

#include "wavecomb/core/frame.h"
#include "wavecomb/core/path_expression.h"
#include "wavecomb/integrate/path_state.h"
#include "wavecomb/light/light.h"

namespace wavecomb {

namespace detail {

/// What scattering between `wo` and `wi` is, of whose diffuse and other parts the light shows
/// `diffuse` and `specular`.
template <typename Bsdf, typename F>
inline ScatteringNote<F> note_scattering(const Bsdf& bsdf, const Vec3<F>& wo, const Vec3<F>& wi,
                                         const F& diffuse, const F& specular) {
  using U = UInt<F>;
  const Color<F> one(F(1.f));
  if constexpr (!Bsdf::kOnSurface)
    return {U(static_cast<uint32_t>(PathEvent::kVolume)), one, Mask<F>(false)};
  const auto seen = bsdf.view(wo);
  const Color<F> all = bsdf.eval(seen, wi).f_cos, part = bsdf.diffuse_f_cos(seen, wi);
  const auto share = [&](const F& f, const F& d) {
    const F shown = d * diffuse;
    const F whole = fma(max(F(f - d), F(0.f)), specular, shown);
    return select(whole > 0.f, min(F(shown / select(whole > 0.f, whole, F(1.f))), F(1.f)), F(0.f));
  };
  const U side = select(Mask<U>(Mask<F>(F(wo.z * wi.z) < 0.f)),
                        U(static_cast<uint32_t>(PathEvent::kTransmission)),
                        U(static_cast<uint32_t>(PathEvent::kReflection)));
  return {side, {share(all.x, part.x), share(all.y, part.y), share(all.z, part.z)}, Mask<F>(false)};
}

}  // namespace detail

/// What a vertex of a path from a light does with light from `l` that goes to `w`, or one of a
/// camera path with light that a connection brings, from `l` to `w`: every lobe shows it whole.
template <typename Bsdf, typename F>
[[gnu::noinline, gnu::cold]] ScatteringNote<F> note_event(const Bsdf bsdf, const Vec3<F> w,
                                                          const Vec3<F> l) {
  return detail::note_scattering<Bsdf, F>(bsdf, w, l, F(1.f), F(1.f));
}

/// Notes in `aovs` what the light sample, along `to_light`, and the bounce, along `next`, scatter
/// at a place of `bsdf` that is seen from `wo`. Everything by value, so that shading need not keep
/// in memory what it keeps in registers.
template <typename Bsdf, typename F>
[[gnu::noinline, gnu::cold]] void note_events(const LightView& lights, const Bsdf bsdf,
                                              const Frame<F> frame, const Vec3<F> wo,
                                              const Vec3<F> to_light, const Vec3<F> next,
                                              const F pdf, const Mask<F> has_shadow,
                                              VertexAovs<F>& aovs) {
  F diffuse(1.f), specular(1.f);
  if (lights.has_effects && any(has_shadow)) {
    const LightEffect<F> effect(lights, aovs.lit_by, has_shadow);
    diffuse = select(effect.applies, effect.diffuse, diffuse);
    specular = select(effect.applies, effect.specular, specular);
  }
  const F all(1.f);
  aovs.lit =
      detail::note_scattering<Bsdf, F>(bsdf, wo, frame.to_local(to_light), diffuse, specular);
  aovs.bounce = detail::note_scattering<Bsdf, F>(bsdf, wo, frame.to_local(next), all, all);
  aovs.bounce.is_delta = not_(Mask<F>(pdf > 0.f));
  if constexpr (Bsdf::kWalks) {
    using U = UInt<F>;
    const Mask<F> enters = bsdf.enters(wo, frame.to_local(next));
    aovs.bounce.event =
        select(Mask<U>(enters), U(static_cast<uint32_t>(PathEvent::kBelow)), aovs.bounce.event);
  }
}

}  // namespace wavecomb
