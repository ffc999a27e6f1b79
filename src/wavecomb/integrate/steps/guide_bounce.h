// SPDX-License-Identifier: Apache-2.0
/// Bounces by a mixture of BSDF and field (learn/guide.h):
///
///   p(wi) = a p_bsdf(wi) + (1 - a) p_guide(wi) [wi is on the side of wo]
///
/// p_bsdf is the density of the technique that the field is mixed with: of the BSDF's lobes, or of
/// the cosine, where bounces are sampled by cosine (bounce_sampling.h).
/// The field says nothing of the far side of a surface, so what is transmitted is the BSDF's alone;
/// a delta lobe is chosen with a times its own probability. Both halves of MIS see p.
#pragma once

#include "wavecomb/integrate/steps/bounce_sampling.h"
#include "wavecomb/integrate/steps/interact.h"
#include "wavecomb/learn/guide.h"

namespace wavecomb {

/// Whether vertices of program `Bsdf` may be guided.
template <typename Bsdf>
inline constexpr bool kGuided = Bsdf::kHasNonDelta && Bsdf::kOnSurface;

/// Where a vertex is in the field.
template <typename Bsdf, typename F, uint32_t kFeatures, typename Interaction>
WAVECOMB_INLINE GuidePlace<F> guide_place(const Vertex<F, kFeatures>& v, const Interaction& at,
                                          const Frame<F>& frame, const Vec3<F>& wo) {
  if constexpr (kGuided<Bsdf>) {
    if (v.guide) [[unlikely]] {
      const Vec3<F> p = fma(v.path.dir, v.t, v.path.o);
      const Vec3<F> n = select<F>(wo.z < 0.f, -frame.n, frame.n);
      GuidePlace<F> place = find_guide<F>(*v.guide, p, guide_axis<F>(n), v.material, v.active);
      place.guided = place.guided & at.bsdf.has_non_delta();
      return place;
    }
  }
  return {};
}

/// Density of a bounce along `world` (`wi`, where z is along the normal), which the BSDF has with
/// `p_bsdf`.
template <typename Bsdf, typename F, uint32_t kFeatures>
WAVECOMB_INLINE F mixed_pdf(const Vertex<F, kFeatures>& v, const GuidePlace<F>& place,
                            const Vec3<F>& world, const Vec3<F>& wi, const Vec3<F>& wo,
                            const F& p_bsdf) {
  if constexpr (kGuided<Bsdf>) {
    if (v.guide && any(place.guided)) [[unlikely]] {
      const Mask<F> near = place.guided & (F(wi.z * wo.z) > 0.f);
      const F p_guide = guide_pdf<F>(*v.guide, place, world, near);
      const F mixed = fma(place.bsdf_share, p_bsdf, F((F(1.f) - place.bsdf_share) * p_guide));
      return select(place.guided, mixed, p_bsdf);
    }
  }
  return p_bsdf;
}

/// Makes of `b`, a bounce by the BSDF, one by the mixture; r.w says who samples. What roughness
/// the ray cone sees is the sampled lobe's in either case. Notes for who learns.
template <typename Bsdf, typename F, uint32_t kFeatures, typename Interaction, typename View>
WAVECOMB_INLINE void guide_bounce(const Vertex<F, kFeatures>& v, const Interaction& at,
                                  const Frame<F>& frame, const Vec3<F>& wo, const View& seen,
                                  const Sample4<F>& r, const GuidePlace<F>& place, BsdfSample<F>& b,
                                  VertexResult<F>& out) {
  if constexpr (kGuided<Bsdf>) {
    if (!v.guide) [[likely]]
      return;
    out.axis = place.axis;
    out.bsdf_pdf = b.pdf;
    const Mask<F>& guided = place.guided;
    if (none(guided)) return;
    const F& a = place.bsdf_share;
    const Mask<F> by_guide = guided & (r.w >= a);
    // f |cos|, and the density without the field.
    Color<F> f_cos = b.weight * b.pdf;
    F p_bsdf = b.pdf;
    if (any(by_guide)) {
      const Vec3<F> wi = frame.to_local(sample_guide<F>(*v.guide, place, r.y, r.z, by_guide));
      const BsdfEval<F> e = at.bsdf.eval(seen, wi);
      const Mask<F> there = F(wi.z * wo.z) > 0.f;
      b.wi = select<F>(by_guide, wi, b.wi);
      f_cos = select<F>(by_guide, select<F>(there, e.f_cos, Color<F>(F(0.f))), f_cos);
      const F unguided = bounce_pdf(v, at.bsdf, wo, seen, wi, e);
      p_bsdf = select(by_guide, select(there, unguided, F(0.f)), p_bsdf);
      b.is_delta = b.is_delta & not_(by_guide);
      b.eta = select(by_guide, F(1.f), b.eta);
    }
    const F mixed = mixed_pdf<Bsdf, F>(v, place, frame.to_world(b.wi), b.wi, wo, p_bsdf);
    // A delta lobe's pdf is the probability of its choice.
    const F pdf = select(b.is_delta, F(a * p_bsdf), mixed);
    b.weight = select<F>(guided, f_cos * F(1.f / select(pdf > 0.f, pdf, F(1.f))), b.weight);
    out.bsdf_pdf = p_bsdf;
    b.pdf = select(guided, pdf, b.pdf);
  }
}

}  // namespace wavecomb
