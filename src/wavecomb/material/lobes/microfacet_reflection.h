// SPDX-License-Identifier: Apache-2.0
/// Microfacet reflection by GGX, without the Fresnel factor.
#pragma once

#include "wavecomb/material/lobes/ggx.h"

namespace wavecomb {

/// Terms of a microfacet that reflects wo to wi, both above the surface.
template <typename F>
struct MicrofacetEval {
  F cos_h;  ///< wo . h = wi . h, the cosine for the Fresnel factor
  F f_cos;  ///< D G2 / (4 z_o): f |cos theta_i| without the Fresnel factor
  F pdf;    ///< D G1 / (4 z_o): density of the visible-normal sampler
};

/// Masking terms that depend on wo only.
template <typename F>
struct MaskedView {
  F s;      ///< Ggx::s(wo)
  F share;  ///< G1 / (4 z_o) = 1 / (2 (z_o + s))

  MaskedView() = default;
  MaskedView(const Ggx<F>& ggx, const Vec3<F>& wo) : s(ggx.s(wo)), share(0.5f / F(wo.z + s)) {}
};

/// Evaluates the Torrance-Sparrow lobe D G2 / (4 z_o z_i) (Walter et al. 2007, eq. 20); 0 if wi or
/// wo is not above the surface. Half-vector Jacobian: dh / dwi = 1 / (4 wo . h) (eq. 14). With unit
/// directions wo . h = |wo + wi| / 2.
template <typename F>
inline MicrofacetEval<F> eval_microfacet(const Ggx<F>& ggx, const MaskedView<F>& view,
                                         const Vec3<F>& wo, const Vec3<F>& wi) {
  const Mask<F> valid = (wo.z > 0.f) & (wi.z > 0.f);
  const Vec3<F> sum = wo + wi;
  const F length2 = length_squared(sum);
  const F d = ggx.d_along(sum, length2);
  const F f_cos = F(0.5f * d * wi.z) / fma(wo.z, ggx.s(wi), F(wi.z * view.s));
  return {min(F(0.5f * sqrt(length2)), F(1.f)), select(valid, f_cos, F(0.f)),
          select(valid, F(d * view.share), F(0.f))};
}
template <typename F>
inline MicrofacetEval<F> eval_microfacet(const Ggx<F>& ggx, const Vec3<F>& wo, const Vec3<F>& wi) {
  return eval_microfacet(ggx, MaskedView<F>(ggx, wo), wo, wi);
}

/// Reflects wo about a sampled visible normal. The direction may lie below the surface, in which
/// case the sample is invalid.
template <typename F>
inline Vec3<F> sample_microfacet(const Ggx<F>& ggx, const Vec3<F>& wo, const F& u, const F& v) {
  return normalize(reflect(wo, ggx.sample_visible(wo, u, v)));
}

}  // namespace wavecomb
