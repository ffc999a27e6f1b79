// SPDX-License-Identifier: Apache-2.0
/// Reflection by a GGX surface, without its Fresnel factor.
#pragma once

#include "wavecomb/material/lobes/ggx.h"

namespace wavecomb {

/// A microfacet configuration that reflects wo to wi, both above the surface.
template <typename F>
struct MicrofacetEval {
  F cos_h;  ///< wo . h = wi . h: the argument of Fresnel's formula
  F f_cos;  ///< D G2 / (4 z_o): f cos without Fresnel
  F pdf;    ///< D G1 / (4 z_o): density of the visible-normal sampler
};

/// Torrance and Sparrow's lobe D G2 / (4 z_o z_i) (Walter et al. 2007, eq. 20); zeros where wi or
/// wo is not above the surface. Half-vector Jacobian: dh / dwi = 1 / (4 wo . h) (eq. 14).
template <typename F>
inline MicrofacetEval<F> eval_microfacet(const Ggx<F>& ggx, const Vec3<F>& wo, const Vec3<F>& wi) {
  const Mask<F> valid = (wo.z > 0.f) & (wi.z > 0.f);
  const Vec3<F> sum = wo + wi;
  const Vec3<F> h = select<F>(valid, sum * F(1.f / length(sum)), Vec3<F>(F(0.f), F(0.f), F(1.f)));
  const F d = ggx.d(h);
  const F f_cos = d * wi.z * ggx.g2_over_4cos(wo, wi);
  const F pdf = 0.5f * d / F(wo.z + ggx.s(wo));
  return {clamp(dot(wo, h), F(0.f), F(1.f)), select(valid, f_cos, F(0.f)),
          select(valid, pdf, F(0.f))};
}

/// A direction reflected by a visible normal; it may lie below the surface, which is no valid
/// sample.
template <typename F>
inline Vec3<F> sample_microfacet(const Ggx<F>& ggx, const Vec3<F>& wo, const F& u, const F& v) {
  return normalize(reflect(wo, ggx.sample_visible(wo, u, v)));
}

}  // namespace wavecomb
