// SPDX-License-Identifier: Apache-2.0
/// Sampling of bounces from the lobes of the BSDF. With the setting `cosine_sampling`, a cosine
/// distribution replaces all lobes except delta lobes.
///
/// Delta lobes keep their selection probability q, so the density of a cosine bounce is
///   p(wi) = (1 - q) |cos theta_i| / pi
/// on the side of wo. Only programs without transmission use cosine sampling.
#pragma once

#include "wavecomb/core/sampler.h"
#include "wavecomb/core/warp.h"
#include "wavecomb/material/bsdf.h"
#include "wavecomb/path/path_state.h"

namespace wavecomb {

/// Returns whether bounces of program `Bsdf` use cosine sampling.
template <typename Bsdf, typename V>
inline bool samples_by_cosine(const V& vertex) {
  return V::has(kExperiments) && vertex.settings.cosine_sampling && !Bsdf::kTransmits;
}

/// Returns the solid angle density of a cosine bounce along `wi`.
template <typename Bsdf, typename F, typename View>
inline F cosine_bounce_pdf(const Bsdf& bsdf, const Vec3<F>& wo, const View& view,
                           const Vec3<F>& wi) {
  const F rest = max(F(1.f - bsdf.delta_probability(view)), F(0.f));
  return select(F(wo.z * wi.z) > 0.f, F(rest * cosine_hemisphere_pdf(abs(wi.z))), F(0.f));
}

/// Returns the density with which bounces sample the direction `wi`. `e` is the result of BSDF
/// evaluation for `wi`.
template <typename Bsdf, typename F, typename V, typename View>
WAVECOMB_INLINE F bounce_pdf(const V& v, const Bsdf& bsdf, const Vec3<F>& wo, const View& view,
                             const Vec3<F>& wi, const BsdfEval<F>& e) {
  return samples_by_cosine<Bsdf>(v) ? cosine_bounce_pdf(bsdf, wo, view, wi) : e.pdf;
}

/// Samples a bounce with the sample values `r`.
template <typename Bsdf, typename F, typename V, typename View>
WAVECOMB_INLINE BsdfSample<F> sample_bounce(const V& vertex, const Bsdf& bsdf, const Vec3<F>& wo,
                                            const View& view, const Sample4<F>& r) {
  BsdfSample<F> b = bsdf.sample(view, r.x, r.y, r.z);
  if (samples_by_cosine<Bsdf>(vertex)) {
    Vec3<F> wi = square_to_cosine_hemisphere(r.y, r.z);
    wi.z = select(wo.z < 0.f, F(-wi.z), wi.z);
    const F pdf = cosine_bounce_pdf(bsdf, wo, view, wi);
    const BsdfEval<F> e = bsdf.eval(view, wi);
    const Mask<F> use = not_(b.is_delta) & (pdf > 0.f);
    const F inv = 1.f / select(pdf > 0.f, pdf, F(1.f));
    b.wi = select<F>(use, wi, b.wi);
    b.weight = select<F>(use, e.f_cos * inv, b.weight);
    b.pdf = select(use, pdf, b.pdf);
  }
  return b;
}

}  // namespace wavecomb
