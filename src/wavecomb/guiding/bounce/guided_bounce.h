// SPDX-License-Identifier: Apache-2.0
/// Bounces sampled from a mixture of BSDF and guiding distribution (guiding/lookup.h):
///
///   p(wi) = a p_bsdf(wi) + (1 - a) p_guide(wi) [wi is on the side of wo]
///
/// where a is GuidingLookup::bsdf_share, and p_bsdf is the density of unguided bounces, which
/// sample the lobes of the BSDF or, with cosine sampling, a cosine lobe (bounce_sampling.h). The
/// guiding distribution covers only the viewer's side of a surface, so transmission is sampled only
/// by the BSDF. The selection probability of a delta lobe is `a` times its selection probability in
/// the BSDF. The MIS weights of bounces and light samples use the density p of the mixture.
#pragma once

#include "wavecomb/guiding/lookup.h"
#include "wavecomb/path/steps/bounce_sampling.h"
#include "wavecomb/path/steps/interact.h"
#include "wavecomb/path/steps/vertex_context.h"

namespace wavecomb {

/// Whether bounces of shading program `Bsdf` can be guided.
template <typename Bsdf>
inline constexpr bool kGuided = Bsdf::kHasNonDelta && Bsdf::kOnSurface;

/// Looks up the guiding distribution at a vertex.
template <typename Bsdf, typename F, uint32_t kFeatures, typename Interaction>
WAVECOMB_INLINE GuidingLookup<F> guiding_lookup(const Vertex<F, kFeatures>& v,
                                                const Interaction& at, const Frame<F>& frame,
                                                const Vec3<F>& wo) {
  if constexpr (kGuided<Bsdf>) {
    if (v.guide) [[unlikely]] {
      const Vec3<F> p = fma(v.path.dir, v.t, v.path.o);
      const Vec3<F> n = select<F>(wo.z < 0.f, -frame.n, frame.n);
      GuidingLookup<F> guiding =
          look_up_guiding<F>(*v.guide, p, guiding_axis<F>(n), v.material, v.active);
      guiding.guided = guiding.guided & at.bsdf.has_non_delta();
      guiding.bsdf_share = select(guiding.guided, guiding.bsdf_share, F(1.f));
      return guiding;
    }
  }
  return {};
}

/// Returns the density of the mixture for a bounce along `world`. `wi` is the same direction in the
/// frame whose z axis is the normal. `p_bsdf` is the density of the BSDF for this direction.
template <typename Bsdf, typename F, uint32_t kFeatures>
WAVECOMB_INLINE F mixed_pdf(const Vertex<F, kFeatures>& v, const GuidingLookup<F>& guiding,
                            const Vec3<F>& world, const Vec3<F>& wi, const Vec3<F>& wo,
                            const F& p_bsdf) {
  if constexpr (kGuided<Bsdf>) {
    if (v.guide && any(guiding.guided)) [[unlikely]] {
      const Mask<F> near = guiding.guided & (F(wi.z * wo.z) > 0.f);
      const F p_guide = guiding_pdf<F>(*v.guide, guiding, world, near);
      const F mixed = fma(guiding.bsdf_share, p_bsdf, F((F(1.f) - guiding.bsdf_share) * p_guide));
      return select(guiding.guided, mixed, p_bsdf);
    }
  }
  return p_bsdf;
}

/// Replaces the bounce `b`, which was sampled from the BSDF, by a sample of the mixture of BSDF and
/// guiding distribution. The random number `r.w` selects one of the two distributions. In both
/// cases, the ray cone uses the roughness of the BSDF lobe that was sampled first. Writes the
/// training data of the bounce to `out`.
template <typename Bsdf, typename F, uint32_t kFeatures, typename Coupling>
WAVECOMB_INLINE void guided_bounce(const VertexContext<Bsdf, F, kFeatures, Coupling>& c,
                                   const Sample4<F>& r, BsdfSample<F>& b, VertexResult<F>& out) {
  if constexpr (kGuided<Bsdf>) {
    const Vertex<F, kFeatures>& v = c.vertex;
    const GuidingLookup<F>& guiding = c.guide;
    if (!v.guide) [[likely]]
      return;
    out.axis = guiding.axis;
    out.bsdf_pdf = b.pdf;
    const Mask<F>& guided = guiding.guided;
    if (none(guided)) return;
    const F& a = guiding.bsdf_share;
    const Mask<F> by_guide = guided & (r.w >= a);
    // Compute f |cos| for the bounce direction, and the density of this direction without guiding.
    Color<F> f_cos = b.weight * b.pdf;
    F p_bsdf = b.pdf;
    if (any(by_guide)) {
      const Vec3<F> wi = c.frame.to_local(sample_guiding<F>(*v.guide, guiding, r.y, r.z, by_guide));
      const BsdfEval<F> e = c.at.bsdf.eval(c.view, wi);
      const Mask<F> same_side = F(wi.z * c.wo.z) > 0.f;
      b.wi = select<F>(by_guide, wi, b.wi);
      f_cos = select<F>(by_guide, select<F>(same_side, e.f_cos, Color<F>(F(0.f))), f_cos);
      const F unguided = bounce_pdf(v, c.at.bsdf, c.wo, c.view, wi, e);
      p_bsdf = select(by_guide, select(same_side, unguided, F(0.f)), p_bsdf);
      b.is_delta = b.is_delta & not_(by_guide);
      b.eta = select(by_guide, F(1.f), b.eta);
    }
    const F mixed = mixed_pdf<Bsdf, F>(v, guiding, c.frame.to_world(b.wi), b.wi, c.wo, p_bsdf);
    // The pdf of a delta lobe is its selection probability.
    const F pdf = select(b.is_delta, F(a * p_bsdf), mixed);
    b.weight = select<F>(guided, f_cos * F(1.f / select(pdf > 0.f, pdf, F(1.f))), b.weight);
    out.bsdf_pdf = p_bsdf;
    b.pdf = select(guided, pdf, b.pdf);
  }
}

}  // namespace wavecomb
