// SPDX-License-Identifier: Apache-2.0
/// Classification of scatterings for light path expressions. Runs only if the render has
/// expressions.
///
/// A BSDF is a sum of lobes, and a direction does not say which lobe scattered the light. A
/// scattering is therefore split by colour: the fraction f_diffuse / f counts as diffuse, the rest
/// as glossy.
#pragma once

#include "wavecomb/core/frame.h"
#include "wavecomb/core/path_expressions/path_expression.h"
#include "wavecomb/light/sampling/light_sample.h"
#include "wavecomb/path/path_state.h"

namespace wavecomb {

namespace detail {

/// Classifies the scattering between `wo` and `wi`. The light's contribution to the diffuse and the
/// other lobes is scaled by `diffuse` and `specular`.
template <typename Bsdf, typename F>
inline ScatteringEvent<F> classify_scattering(const Bsdf& bsdf, const Vec3<F>& wo,
                                              const Vec3<F>& wi, const F& diffuse,
                                              const F& specular) {
  using U = UInt<F>;
  const Color<F> one(F(1.f));
  if constexpr (!Bsdf::kOnSurface)
    return {U(static_cast<uint32_t>(PathEvent::kVolume)), one, Mask<F>(false)};
  const auto view = bsdf.view(wo);
  const Color<F> all = bsdf.eval(view, wi).f_cos, part = bsdf.diffuse_f_cos(view, wi);
  const auto share = [&](const F& f, const F& d) {
    const F weighted_diffuse = d * diffuse;
    const F whole = fma(max(F(f - d), F(0.f)), specular, weighted_diffuse);
    return select(whole > 0.f,
                  min(F(weighted_diffuse / select(whole > 0.f, whole, F(1.f))), F(1.f)), F(0.f));
  };
  const U side = select(Mask<U>(Mask<F>(F(wo.z * wi.z) < 0.f)),
                        U(static_cast<uint32_t>(PathEvent::kTransmission)),
                        U(static_cast<uint32_t>(PathEvent::kReflection)));
  return {side, {share(all.x, part.x), share(all.y, part.y), share(all.z, part.z)}, Mask<F>(false)};
}

}  // namespace detail

/// Classifies the scattering from `l` to `w` at a vertex of a light path, or of a connection at a
/// vertex of a camera path. All lobes count fully, since such lights have no multipliers.
template <typename Bsdf, typename F>
[[gnu::noinline, gnu::cold]] ScatteringEvent<F> classify_event(const Bsdf bsdf, const Vec3<F> w,
                                                               const Vec3<F> l) {
  return detail::classify_scattering<Bsdf, F>(bsdf, w, l, F(1.f), F(1.f));
}

/// Records in `aovs` how the light sample along `to_light` and the bounce along `next` scatter at a
/// point with `bsdf` that is viewed from `wo`. The arguments are passed by value, so that shading
/// can keep them in registers.
template <typename Bsdf, typename F>
[[gnu::noinline, gnu::cold]] void classify_events(const LightView& lights, const Bsdf bsdf,
                                                  const Frame<F> frame, const Vec3<F> wo,
                                                  const Vec3<F> to_light, const Vec3<F> next,
                                                  const F pdf, const Mask<F> has_shadow,
                                                  VertexAovs<F>& aovs) {
  F diffuse(1.f), specular(1.f);
  if (lights.has_effects && any(has_shadow)) {
    const LightEffect<F> effect(lights, aovs.light_id, has_shadow);
    diffuse = select(effect.applies, effect.diffuse, diffuse);
    specular = select(effect.applies, effect.specular, specular);
  }
  const F all(1.f);
  aovs.light_scattering =
      detail::classify_scattering<Bsdf, F>(bsdf, wo, frame.to_local(to_light), diffuse, specular);
  aovs.bounce = detail::classify_scattering<Bsdf, F>(bsdf, wo, frame.to_local(next), all, all);
  aovs.bounce.is_delta = not_(Mask<F>(pdf > 0.f));
  if constexpr (Bsdf::kHasSubsurface) {
    using U = UInt<F>;
    const Mask<F> enters = bsdf.enters(wo, frame.to_local(next));
    aovs.bounce.event = select(Mask<U>(enters), U(static_cast<uint32_t>(PathEvent::kSubsurface)),
                               aovs.bounce.event);
  }
}

}  // namespace wavecomb
