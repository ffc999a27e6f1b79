// SPDX-License-Identifier: Apache-2.0
/// Reflection and refraction by a GGX dielectric interface (Walter et al., "Microfacet Models for
/// Refraction through Rough Surfaces", EGSR 2007).
#pragma once

#include "wavecomb/material/bsdf.h"
#include "wavecomb/material/lobes/ggx.h"
#include "wavecomb/material/lobes/smooth_dielectric.h"

namespace wavecomb {

/// Whether the interface must be treated as smooth, because its reflection lobe (width alpha) or
/// its refraction lobe (width about alpha |eta - 1|) is too narrow.
template <typename F>
inline Mask<F> is_smooth_dielectric(const F& alpha, const F& ior) {
  return (alpha < kDeltaAlpha) | (alpha * abs(F(ior - 1.f)) < 1e-4f);
}

/// Rough dielectric interface. Holds references to the parameters of a BSDF.
template <typename F>
struct RoughDielectric {
  const Ggx<F>& ggx;
  const F& ior;          ///< index of refraction of the inner side relative to the outer side
  const Color<F>& tint;  ///< of transmission
  const F& roughness;    ///< for BsdfSample::roughness
  bool schlick;          ///< whether reflectance uses Schlick's approximation
};

/// Evaluates f |cos theta_i| and the density of sample_rough_dielectric(). R and T are the Fresnel
/// reflectance and transmittance, eta is the relative index for a ray from the side of wo, and c =
/// wi . h + (wo . h) / eta:
///   reflection:   f cos = R D G2 / (4 |z_o|),                      pdf = R D G1 / (4 |z_o|);
///   transmission: f cos = T D G2 |wi.h wo.h| / (|z_o| c^2 eta^2),
///                 pdf = T D G1 |wi.h wo.h| / (|z_o| c^2),
/// eq. 20 and 21 with the Jacobians of eq. 14 and 17. The factor 1 / eta^2 scales radiance.
template <typename F>
inline BsdfEval<F> eval_rough_dielectric(const RoughDielectric<F>& lobe, const Vec3<F>& wo,
                                         const Vec3<F>& wi) {
  const auto& [ggx, ior, tint, roughness, schlick] = lobe;
  const F eta = relative_ior(wo, ior);
  const F side = copysign(F(1.f), wo.z);
  const Mask<F> reflects = F(wi.z * side) > 0.f;
  // `h` is the microfacet normal on the side of wo.
  const Vec3<F> sum = fma(wi, select(reflects, F(1.f), eta), wo);
  const F len2 = length_squared(sum);
  const Mask<F> nonzero = (len2 > 1e-20f) & (wi.z != 0.f) & (wo.z != 0.f);
  const F inv_len = 1.f / sqrt(select(nonzero, len2, F(1.f)));
  const F up = copysign(F(1.f), sum.z) * side;  // flips h to the side of wo
  const Vec3<F> h = sum * F(inv_len * up);
  const F oh = dot(wo, h), ih = dot(wi, h);
  // Microfacets seen from behind are invalid. For refraction, wo and wi must be on opposite sides
  // of h.
  const Mask<F> valid = nonzero & (oh > 0.f) & (F(h.z * side) > 0.f) &
                        ((reflects & (ih > 0.f)) | (not_(reflects) & (ih < 0.f)));
  const F r = fresnel_dielectric(oh, eta, schlick).reflectance;
  const F d = ggx.d(h);
  const F g2 = ggx.g2_over_4cos(wo, wi);         // G2 / (4 |z_o z_i|)
  const F g1 = 0.5f / F(abs(wo.z) + ggx.s(wo));  // G1 / (4 |z_o|)
  const F c = ih + F(oh / eta);
  const F c2 = max(F(c * c), F(1e-20f));
  const F jacobian = select(reflects, F(1.f), F(F(-4.f * ih * oh) / c2));
  const F base = select(reflects, r, F(1.f - r)) * d * jacobian;
  const F f_cos = select(valid, F(base * g2 * abs(wi.z)), F(0.f));
  const F inv_eta2 = 1.f / sqr(eta);
  const Color<F> color = select<F>(reflects, Color<F>(F(1.f)), tint * inv_eta2);
  return {color * f_cos, select(valid, F(base * g1), F(0.f))};
}

/// Samples a visible normal, then chooses reflection with probability R. The weight is G2 / G1,
/// times tint / eta^2 for transmission.
template <typename F>
inline BsdfSample<F> sample_rough_dielectric(const RoughDielectric<F>& lobe, const Vec3<F>& wo,
                                             const F& u_lobe, const F& u, const F& v) {
  const auto& [ggx, ior, tint, roughness, schlick] = lobe;
  const F eta = relative_ior(wo, ior);
  const F side = copysign(F(1.f), wo.z);
  const Vec3<F> wo_up(wo.x, wo.y, abs(wo.z));
  const Vec3<F> h_up = ggx.sample_visible(wo_up, u, v);
  const F cos_h = clamp(dot(wo_up, h_up), F(0.f), F(1.f));
  const auto [r, cos_t] = fresnel_dielectric(cos_h, eta, schlick);
  const Mask<F> reflects = u_lobe < r;
  const Vec3<F> wi_up =
      normalize(select<F>(reflects, reflect(wo_up, h_up), refract(wo_up, h_up, cos_h, cos_t, eta)));
  const Mask<F> right_side =
      (reflects & (wi_up.z > 0.f)) | (not_(reflects) & (wi_up.z < 0.f) & (cos_t > 0.f));
  BsdfSample<F> s;
  s.wi = Vec3<F>(wi_up.x, wi_up.y, wi_up.z * side);
  const BsdfEval<F> e = eval_rough_dielectric(lobe, wo, s.wi);
  const Mask<F> valid = right_side & (e.pdf > 0.f);
  const F g = ggx.g2_over_g1(wo_up, wi_up);
  const F inv_eta2 = 1.f / sqr(eta);
  s.weight = select<F>(reflects, Color<F>(g), tint * F(g * inv_eta2));
  s.weight = select<F>(valid, s.weight, Color<F>(F(0.f)));
  s.pdf = select(valid, e.pdf, F(0.f));
  s.wi = select<F>(valid, s.wi, Vec3<F>(F(0.f), F(0.f), F(1.f)));
  s.is_delta = Mask<F>(false);
  s.eta = select(reflects | not_(valid), F(1.f), eta);
  s.roughness = roughness;
  return s;
}

}  // namespace wavecomb
