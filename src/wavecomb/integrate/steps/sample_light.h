// SPDX-License-Identifier: Apache-2.0
/// The step `sample_light`: next event estimation, one light sample a vertex.
///
/// A light, and a point of it in direction wi, chosen with density p_light over solid angle:
///   L += T_k f(wo, wi) |cos theta_i| Le / p_light  w  V,   w = p_light / (p_bounce + p_light)
/// (balance heuristic, Veach 1997, 9.2; w = 1 for deltas, which no bounce finds). V is the shadow
/// ray's to find.
#pragma once

#include "wavecomb/integrate/steps/bounce_sampling.h"
#include "wavecomb/integrate/steps/guide_bounce.h"
#include "wavecomb/integrate/steps/interact.h"
#include "wavecomb/integrate/steps/join.h"
#include "wavecomb/light/light.h"
#include "wavecomb/light/shadow_look.h"

namespace wavecomb {

/// Who light is chosen for; its place is set where light is sampled.
template <typename Bsdf, typename F, uint32_t kFeatures>
WAVECOMB_INLINE LightReceiver<F> light_receiver(const Vertex<F, kFeatures>& v,
                                                const Frame<F>& frame, const Vec3<F>& wo) {
  LightReceiver<F> receiver(Vec3<F>(F(0.f)));
  if (v.has(kMotion) && v.scene.lights.motions) [[unlikely]]
    receiver.time = v.hit.time;
  if (v.scene.lights.by_tree) {
    // What reflects alone is lit on the side that it is seen from.
    if (!Bsdf::kTransmits)
      receiver.normal = pack_normal<F>(select<F>(wo.z < 0.f, -frame.n, frame.n));
    receiver.seed =
        hash_u32<UInt<F>>(v.key.pixel_hash, UInt<F>(v.key.sample + 0x632be5abu * (v.depth + 1)));
  }
  return receiver;
}

/// Weight of the light sample `l` of `light` beside bounces, of density `p_bounce`, and paths from
/// the light (join.h): with R up to this vertex and p_light in place of p_bounce,
///   w = 1 / (1 + p_bounce / p_light + R D / p_light);   a point has p_light d^2 in the last.
template <typename Bsdf, typename F, uint32_t kFeatures, typename Interaction>
WAVECOMB_INLINE F joint_light_weight(const Vertex<F, kFeatures>& v, const Interaction& at,
                                     const JointVertex<F>& joint, const Vec3<F>& wo,
                                     const LightSample<F>& l, const Vec3<F>& wi, const F& p_bounce,
                                     const UInt<F>& light, const Vec3<F>& from) {
  const LightView& lights = v.scene.lights;
  const F pdf = select(l.pdf > 0.f, l.pdf, F(1.f));
  const F by_bounce = select(l.is_delta, F(0.f), F(p_bounce / pdf));
  if (!lights.sends_paths()) return 1.f / F(1.f + by_bounce);
  const F density = emission_density<F>(lights, light, from, l.wi, l.distance, l.valid);
  const Mask<F> point = l.is_delta & (l.distance < kFarAway);
  const F nee = select(point, F(pdf * F(l.distance * l.distance)), pdf);
  const F by_path = F(joint.template towards<Bsdf>(v, at, wo, l.wi, wi) * density) / nee;
  return 1.f / F(F(1.f + by_bounce) + min(by_path, F(kMostRatio)));
}

/// Chooses a point of a light and the shadow ray that asks whether it is seen. `out.next.link` is
/// known.
template <typename Bsdf, typename F, uint32_t kFeatures, typename Interaction, typename View>
WAVECOMB_INLINE void sample_light(const Vertex<F, kFeatures>& v, const Interaction& at,
                                  const Frame<F>& frame, const Vec3<F>& wo, const View& seen,
                                  const Sample4<F>& r, const GuidePlace<F>& place,
                                  const JointVertex<F>& joint, LightReceiver<F>& receiver,
                                  VertexResult<F>& out) {
  using U = UInt<F>;
  const LightView& lights = v.scene.lights;
  const Mask<F> lit = v.active & at.bsdf.has_non_delta();
  if (!Bsdf::kHasNonDelta || lights.count == 0 || none(lit)) return;
  // Light is gathered where reflected rays will start, so that both techniques agree.
  receiver.p = at.origin(-v.path.dir);
  const LightSample<F> l = sample_light<F>(lights, receiver, r.x, r.y, r.z, lit);
  const Vec3<F> wi = frame.to_local(l.wi);
  const BsdfEval<F> e = at.bsdf.eval(seen, wi);
  const F p_bounce =
      mixed_pdf<Bsdf, F>(v, place, l.wi, wi, wo, bounce_pdf(v, at.bsdf, wo, seen, wi, e));
  F w = select(l.is_delta, F(1.f), F(l.pdf / max(F(l.pdf + p_bounce), F(1e-30f))));
  Color<F> f_cos = e.f_cos;
  U light(kNoLight);
  const bool has_effects = v.has(kMeshLights) && lights.has_effects;
  if ((kFeatures & kJoined) != 0 || has_effects || v.has_links() || v.wants_lights()) [[unlikely]]
    light = chosen_light<F>(lights, receiver, r.x, lit);
  if constexpr ((kFeatures & kJoined) != 0)
    w = joint_light_weight<Bsdf, F>(v, at, joint, wo, l, wi, p_bounce, light, receiver.p);
  ShadowReach<F> reach{F(kFarAway), Color<F>(F(0.f))};
  if (has_effects) [[unlikely]] {
    const LightEffect<F> effect(lights, light, lit);
    const Color<F> diffuse = at.bsdf.diffuse_f_cos(seen, wi);
    f_cos = select<F>(effect.applies,
                      fma(f_cos - diffuse, effect.specular, diffuse * effect.diffuse), f_cos);
    w = select(effect.sampled_only, F(1.f), w);
    if (lights.shadows) [[unlikely]]
      reach = shadow_reach<F>(lights, effect.shadow, r.w, lit);
  }
  if (v.has_links()) [[unlikely]] {
    w = select(shines_on<F>(lights, out.next.link, light, lit), w, F(0.f));
    out.shadow_set = shadow_set<F>(lights, light, lit);
  }
  const Color<F> c =
      clean<F>(at.throughput * f_cos * l.weight * w, clamp_limit(v.settings, v.depth + 1));
  out.has_shadow = lit & l.valid & at.is_consistent(l.wi, wi) & (max_component(c) > 0.f);
  out.direct = c;
  if (v.wants_lights()) {
    v.aovs->lit_by = light;
    v.aovs->lit_at = receiver.p;
    v.aovs->light_weight = w;
  }
  out.shadow_o = at.origin(l.wi);
  out.shadow_d = l.wi;
  out.shadow_tfar = l.distance * kShadowReach;
  if (has_effects) [[unlikely]] {
    out.shadow_tfar = min(out.shadow_tfar, reach.distance);
    out.shade = reach.color;
  }
}

}  // namespace wavecomb
