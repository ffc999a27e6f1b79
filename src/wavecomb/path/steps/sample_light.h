// SPDX-License-Identifier: Apache-2.0
/// The step `sample_light`: next event estimation with one shadow ray for each vertex.
///
/// A light and a point on it in direction wi are sampled with density p_light over solid angle:
///   L += T_k f(wo, wi) |cos theta_i| Le / p_light  w  V,   w = p_light / (p_bounce + p_light)
/// (balance heuristic, Veach 1997, 9.2; w = 1 for delta lights, which no bounce hits). The shadow
/// ray determines the visibility V.
///
/// Light samples whose contribution has a luminance y below LightView::shadow_threshold get their
/// shadow ray with probability q = y / threshold, and are then divided by q. Shadow rays that would
/// hardly change the image are saved (docs/decisions/roulette.md).
#pragma once

#include <algorithm>
#include <cmath>

#include "wavecomb/guiding/bounce/guided_bounce.h"
#include "wavecomb/light/filters/shadow.h"
#include "wavecomb/light/sampling/light_sample.h"
#include "wavecomb/path/steps/bounce_sampling.h"
#include "wavecomb/path/steps/interact.h"
#include "wavecomb/path/steps/light_connection.h"
#include "wavecomb/path/steps/vertex_context.h"

namespace wavecomb {

/// Returns the receiver for light sampling, without its position, which is set when a light is
/// sampled.
template <typename Bsdf, typename F, uint32_t kFeatures>
WAVECOMB_INLINE LightReceiver<F> light_receiver(const Vertex<F, kFeatures>& v,
                                                const Frame<F>& frame, const Vec3<F>& wo) {
  LightReceiver<F> receiver(Vec3<F>(F(0.f)));
  if (v.has(kMotion) && v.scene.lights.motions) [[unlikely]]
    receiver.time = v.hit.time;
  if (v.scene.lights.by_tree) {
    // A surface without transmission receives light only on the viewer's side.
    if (!Bsdf::kTransmits)
      receiver.normal = pack_normal<F>(select<F>(wo.z < 0.f, -frame.n, frame.n));
    receiver.seed =
        hash_u32<UInt<F>>(v.key.pixel_hash, UInt<F>(v.key.sample + 0x632be5abu * (v.depth + 1)));
  }
  return receiver;
}

namespace detail {

/// Light sample at a vertex, and its contribution.
template <typename F>
struct LightCandidate {
  Vec3<F> origin;  ///< origin of the shadow ray
  Vec3<F> wi;
  F distance;
  Color<F> c;     ///< contribution if the light is visible, divided by the density
  F w;            ///< MIS weight, included in c
  Mask<F> valid;  ///< whether the contribution may be non-zero; if not, `c` is undefined
  UInt<F> light;
  UInt<F> shadow_set;      ///< for linked lights
  ShadowExtent<F> extent;  ///< extent of the shadow, for lights with shadow attributes
};

/// Samples a light with the sample values `r` in the lanes `active_lights`. `receiver` is
/// VertexContext::receiver with its position set. `link` is the link class of the surface.
template <typename Bsdf, typename F, uint32_t kFeatures, typename Coupling>
WAVECOMB_INLINE LightCandidate<F> light_candidate(
    const VertexContext<Bsdf, F, kFeatures, Coupling>& c, const LightReceiver<F>& receiver,
    const Sample4<F>& r, const UInt<F>& link, const Mask<F>& active_lights) {
  using U = UInt<F>;
  const Vertex<F, kFeatures>& v = c.vertex;
  const auto& at = c.at;
  const LightView& lights = v.scene.lights;
  const LightConnection<F> to_light = connect_to_light<Bsdf, F>(v, at, receiver, r, active_lights);
  const LightSample<F>& l = to_light.light;
  const Vec3<F> wi = c.frame.to_local(l.wi);
  const BsdfEval<F> e = at.bsdf.eval(c.view, wi);
  const F p_bounce =
      mixed_pdf<Bsdf, F>(v, c.guide, l.wi, wi, c.wo, bounce_pdf(v, at.bsdf, c.wo, c.view, wi, e));
  F w = select(l.is_delta, F(1.f), F(l.pdf / max(F(l.pdf + p_bounce), F(1e-30f))));
  Color<F> f_cos = e.f_cos;
  const U& light = l.light;
  U set(0u);
  const bool has_effects = v.has(kMeshLights) && lights.has_effects;
  w = c.joint.light_weight(c, to_light, wi, p_bounce, w);
  ShadowExtent<F> extent{F(kFarAway), Color<F>(F(0.f))};
  if (has_effects) [[unlikely]] {
    const LightEffect<F> effect(lights, light, active_lights);
    const Color<F> diffuse = at.bsdf.diffuse_f_cos(c.view, wi);
    f_cos = select<F>(effect.applies,
                      fma(f_cos - diffuse, effect.specular, diffuse * effect.diffuse), f_cos);
    w = select(effect.sampled_only, F(1.f), w);
    if (lights.shadows) [[unlikely]]
      extent = shadow_extent<F>(lights, effect.shadow, r.w, active_lights);
  }
  if (v.has_links()) [[unlikely]] {
    w = select(illuminates<F>(lights, link, light, active_lights), w, F(0.f));
    set = shadow_set<F>(lights, light, active_lights);
  }
  Mask<F> valid = active_lights & l.valid & at.is_consistent(l.wi, wi);
  // Light that enters a subsurface body is not sampled here but by the random walk
  // (medium/subsurface/random_walk.h).
  if constexpr ((kFeatures & kSubsurface) != 0 && Bsdf::kHasSubsurface)
    valid = valid & not_(at.bsdf.enters(c.wo, wi));
  return {to_light.origin, l.wi, l.distance, at.throughput * f_cos * l.weight * w, w, valid,
          light,           set,  extent};
}

/// Number of light samples that a vertex on a fibre evaluates.
inline constexpr uint32_t kFibreCandidates = 3;

/// Selects one of several light samples x_i with a probability proportional to the luminance g_i of
/// its unoccluded contribution c_i:
///   c = c_k sum_i g_i / (n g_k),   k with probability g_k / sum_i g_i
/// (resampled importance sampling: J. Talbot, D. Cline, P. Egbert, "Importance Resampling for
/// Global Illumination", 2005). The expected value is the same as with a single light sample, for
/// any densities and MIS weights in c. The MIS weights of a single light sample therefore stay
/// valid. On hair, where shadow rays are expensive, selecting an important light justifies the
/// evaluation of several light samples (docs/decisions/light-candidates.md). `first` is the
/// candidate for the sample values `r`. The other candidates use shifted sample values: evenly over
/// all lights, and on each light by the R2 lattice (M. Roberts, "The Unreasonable Effectiveness of
/// Quasirandom Sequences", 2018).
template <typename F, typename Candidate>
WAVECOMB_INLINE LightCandidate<F> resample(const LightCandidate<F>& first, const Sample4<F>& r, F u,
                                           const Candidate& candidate) {
  using U = UInt<F>;
  constexpr float kN = kFibreCandidates, kSteps[2] = {0.7548777f, 0.5698403f};
  const auto brightness = [](const LightCandidate<F>& one) {
    return select(one.valid, luminance(clean<F>(one.c, 0.f)), F(0.f));
  };
  const auto moved = [](const F& x, float by) {
    const F y = x + (by - std::floor(by));
    return select(y < 1.f, y, F(y - 1.f));
  };
  LightCandidate<F> chosen_candidate = first;
  F g = brightness(first), sum = g;
  for (uint32_t k = 1; k < kFibreCandidates; ++k) {
    const auto n = static_cast<float>(k);
    const LightCandidate<F> other = candidate(
        Sample4<F>{moved(r.x, n / kN), moved(r.y, n * kSteps[0]), moved(r.z, n * kSteps[1]), r.w});
    const F h = brightness(other);
    sum += h;
    // The same random number is used for all selections. Rescaling after each selection makes this
    // number uniform again.
    const F q = select(h > 0.f, F(h / select(h > 0.f, sum, F(1.f))), F(0.f));
    const Mask<F> replaces = u < q;
    u = select(replaces, F(u / max(q, F(1e-20f))), F((u - q) / max(F(1.f - q), F(1e-20f))));
    g = select(replaces, h, g);
    chosen_candidate.origin = select<F>(replaces, other.origin, chosen_candidate.origin);
    chosen_candidate.wi = select<F>(replaces, other.wi, chosen_candidate.wi);
    chosen_candidate.distance = select(replaces, other.distance, chosen_candidate.distance);
    chosen_candidate.c = select<F>(replaces, other.c, chosen_candidate.c);
    chosen_candidate.w = select(replaces, other.w, chosen_candidate.w);
    chosen_candidate.valid = (replaces & other.valid) | (not_(replaces) & chosen_candidate.valid);
    chosen_candidate.light = select(Mask<U>(replaces), other.light, chosen_candidate.light);
    chosen_candidate.shadow_set =
        select(Mask<U>(replaces), other.shadow_set, chosen_candidate.shadow_set);
    chosen_candidate.extent.distance =
        select(replaces, other.extent.distance, chosen_candidate.extent.distance);
    chosen_candidate.extent.color =
        select<F>(replaces, other.extent.color, chosen_candidate.extent.color);
  }
  chosen_candidate.c = chosen_candidate.c * F(sum / select(g > 0.f, F(g * kN), F(1.f)));
  return chosen_candidate;
}

}  // namespace detail

namespace detail {

/// Applies Russian roulette to the shadow ray of the light sample in `out`. `limit` is the largest
/// luminance that a contribution may have; 0 means no limit.
template <typename F, uint32_t kFeatures>
WAVECOMB_INLINE void survive_shadow(const Vertex<F, kFeatures>& v, float limit,
                                    VertexResult<F>& out) {
  float threshold = v.scene.lights.shadow_threshold;
  if (threshold <= 0.f) return;
  if (limit > 0.f) threshold = std::min(threshold, limit);
  using U = UInt<F>;
  const F u = unit_float<F>(hash_u32<U>(path_hash<F>(v.key), U(0x2545f491u + v.depth)));
  const F q = min(F(luminance(out.direct) * (1.f / threshold)), F(1.f));
  out.has_shadow = out.has_shadow & (u < q);
  out.direct = out.direct * F(1.f / max(q, F(1e-10f)));
}

}  // namespace detail

/// Samples a point on a light, and sets up its shadow ray. `out.next.link` must be set.
template <typename Bsdf, typename F, uint32_t kFeatures, typename Coupling>
WAVECOMB_INLINE void sample_light(const VertexContext<Bsdf, F, kFeatures, Coupling>& c,
                                  const Sample4<F>& r, VertexResult<F>& out) {
  const Vertex<F, kFeatures>& v = c.vertex;
  const auto& at = c.at;
  const LightView& lights = v.scene.lights;
  const Mask<F> active_lights = v.active & at.bsdf.has_non_delta();
  if (!Bsdf::kHasNonDelta || lights.count == 0 || none(active_lights)) return;
  LightReceiver<F> receiver = c.receiver;
  receiver.p = at.origin(-v.path.dir);
  const auto candidate = [&](const Sample4<F>& u) {
    return detail::light_candidate(c, receiver, u, out.next.link, active_lights);
  };
  detail::LightCandidate<F> one = candidate(r);
  if constexpr (Bsdf::kOnFibre)
    if (lights.count > 1)
      one = detail::resample<F>(one, r, candidate_number<F>(v.key, v.depth), candidate);
  const float limit = clamp_limit(v.settings, v.depth + 1);
  out.direct = clean<F>(one.c, limit);
  out.has_shadow = one.valid & (max_component(out.direct) > 0.f);
  detail::survive_shadow<F>(v, limit, out);
  if (v.has_links()) [[unlikely]]
    out.shadow_set = one.shadow_set;
  if (v.wants_lights()) {
    v.aovs->light_id = one.light;
    v.aovs->light_position = one.origin;
    v.aovs->light_weight = one.w;
  }
  out.shadow_o = one.origin;
  out.shadow_d = one.wi;
  out.shadow_tfar = one.distance * kShadowRayFraction;
  if (v.has(kMeshLights) && lights.has_effects) [[unlikely]] {
    out.shadow_tfar = min(out.shadow_tfar, one.extent.distance);
    out.shadow_tint = one.extent.color;
  }
}

}  // namespace wavecomb
