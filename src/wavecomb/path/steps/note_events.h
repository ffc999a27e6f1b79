// SPDX-License-Identifier: Apache-2.0
/// Classification of scattering events for light path expressions. These functions run only if the
/// render has light path expressions.
///
/// A BSDF is a sum of lobes, and a direction does not say which lobe scattered the light. A
/// scattering event is therefore split for each colour channel: the fraction f_diffuse / f counts
/// as diffuse, and the remaining fraction as glossy.
#pragma once

#include "wavecomb/core/frame.h"
#include "wavecomb/core/path_expressions/path_expression.h"
#include "wavecomb/light/sampling/light_sample.h"
#include "wavecomb/path/path_state.h"
#include "wavecomb/path/steps/vertex_context.h"

namespace wavecomb {

/// Classifies the scattering between `wo` and `wi`. The light's multiplier of diffuse lobes is
/// `diffuse`, and its multiplier of all other lobes is `specular`.
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

namespace detail {

/// Directions that light takes at a vertex: to the light sample and along the bounce. The members
/// are copies, so that shading can keep the originals in registers.
template <typename Bsdf, typename F>
struct VertexDirections {
  Bsdf bsdf;
  Frame<F> frame;
  Vec3<F> wo;          ///< in `frame`
  Vec3<F> to_light;    ///< in world space
  Mask<F> has_shadow;  ///< lanes with a light sample
  Vec3<F> bounce;      ///< in world space
  F bounce_pdf;        ///< 0 for a delta bounce
};

/// Records in `aovs` how the light sample and the bounce scatter.
template <typename Bsdf, typename F>
[[gnu::noinline, gnu::cold]] void note_directions(const LightView& lights,
                                                  const VertexDirections<Bsdf, F> at,
                                                  VertexAovs<F>& aovs) {
  F diffuse(1.f), specular(1.f);
  if (lights.has_effects && any(at.has_shadow)) {
    const LightEffect<F> effect(lights, aovs.light_id, at.has_shadow);
    diffuse = select(effect.applies, effect.diffuse, diffuse);
    specular = select(effect.applies, effect.specular, specular);
  }
  const F all(1.f);
  aovs.light_scattering = classify_scattering<Bsdf, F>(
      at.bsdf, at.wo, at.frame.to_local(at.to_light), diffuse, specular);
  aovs.bounce =
      classify_scattering<Bsdf, F>(at.bsdf, at.wo, at.frame.to_local(at.bounce), all, all);
  aovs.bounce.is_delta = not_(Mask<F>(at.bounce_pdf > 0.f));
  if constexpr (Bsdf::kHasSubsurface) {
    using U = UInt<F>;
    const Mask<F> enters = at.bsdf.enters(at.wo, at.frame.to_local(at.bounce));
    aovs.bounce.event = select(Mask<U>(enters), U(static_cast<uint32_t>(PathEvent::kSubsurface)),
                               aovs.bounce.event);
  }
}

}  // namespace detail

/// Records in the AOVs of the vertex how its light sample and its bounce in `out` scatter.
template <typename Bsdf, typename F, uint32_t kFeatures, typename Coupling>
WAVECOMB_INLINE void classify_events(const VertexContext<Bsdf, F, kFeatures, Coupling>& c,
                                     const VertexResult<F>& out) {
  using Scattering = typename VertexContext<Bsdf, F, kFeatures, Coupling>::Scattering;
  detail::note_directions<Scattering, F>(c.vertex.scene.lights,
                                         {.bsdf = c.at.bsdf,
                                          .frame = c.frame,
                                          .wo = c.wo,
                                          .to_light = out.shadow_d,
                                          .has_shadow = out.has_shadow,
                                          .bounce = out.next.dir,
                                          .bounce_pdf = out.next.pdf},
                                         *c.vertex.aovs);
}

}  // namespace wavecomb
