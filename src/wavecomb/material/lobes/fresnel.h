// SPDX-License-Identifier: Apache-2.0
/// Fresnel reflectance: exact for dielectrics and conductors, and Schlick's approximations.
#pragma once

#include "wavecomb/core/math.h"
#include "wavecomb/core/vec.h"

namespace wavecomb {

/// Reflectance of a dielectric interface and the cosine of the refracted ray.
template <typename F>
struct DielectricFresnel {
  F reflectance;  ///< unpolarised; 1 under total internal reflection
  F cos_t;        ///< >= 0; 0 under total internal reflection
};

/// (1 - c)^5 for c clamped to [0, 1].
template <typename F>
inline F schlick_weight(const F& cos_i) {
  const F m = 1.f - clamp(cos_i, F(0.f), F(1.f));
  const F m2 = m * m;
  return m2 * m2 * m;
}

/// Reflectance at normal incidence for the relative index `eta`: ((1 - eta) / (1 + eta))^2.
template <typename F>
inline F f0_from_ior(const F& eta) {
  return sqr(F(F(1.f - eta) / F(1.f + eta)));
}

/// F0 + (1 - F0) (1 - c)^5 (Schlick, "An Inexpensive BRDF Model for Physically-based Rendering",
/// 1994, eq. 24).
template <typename F>
inline Color<F> fresnel_schlick(const Color<F>& f0, const F& cos_i) {
  return lerp(f0, Color<F>(F(1.f)), schlick_weight(cos_i));
}

/// Cosine of the refracted ray for cos_i >= 0 (Snell's law); 0 under total internal reflection.
template <typename F>
inline F refracted_cos(const F& cos_i, const F& eta) {
  const F sin2_i = max(fnma(cos_i, cos_i, F(1.f)), F(0.f));
  return safe_sqrt(F(1.f - sin2_i / sqr(eta)));
}

/// Exact reflectance of a dielectric for cosines c of incidence and t of refraction (Born and Wolf,
/// "Principles of Optics", 1.5.2, eq. 20 and 21, averaged over the two polarisations):
///   (p^2 + s^2) / 2,  p = (eta c - t) / (eta c + t),  s = (c - eta t) / (c + eta t)
template <typename F>
inline F dielectric_reflectance(const F& c, const F& t, const F& eta) {
  const F a = eta * c, b = eta * t;
  const F p = a + t, s = c + b;
  // At eta = 1 both denominators vanish at c = 0, where the reflectance is 0.
  const F inverse = 1.f / max(F(p * s), F(1e-30f));
  const F parallel = F(a - t) * s * inverse, perpendicular = F(c - b) * p * inverse;
  return 0.5f * fma(parallel, parallel, sqr(perpendicular));
}

/// Exact reflectance of a dielectric for cos_i >= 0; eta = eta_t / eta_i > 0.
template <typename F>
inline DielectricFresnel<F> fresnel_dielectric(const F& cos_i, const F& eta) {
  const F c = clamp(cos_i, F(0.f), F(1.f));
  const F t = refracted_cos(c, eta);
  const F r = dielectric_reflectance(c, t, eta);
  const F sin2_i = max(fnma(c, c, F(1.f)), F(0.f));
  const Mask<F> total = sin2_i >= sqr(eta);
  return {select(total & (eta < 1.f), F(1.f), min(r, F(1.f))), t};
}

/// Schlick's approximation for a dielectric. The formula uses the cosine on the side of the lower
/// index, so that reflectance is symmetric and continuous at the onset of total internal
/// reflection.
template <typename F>
inline DielectricFresnel<F> fresnel_dielectric_schlick(const F& cos_i, const F& eta) {
  const F c = clamp(cos_i, F(0.f), F(1.f));
  const F t = refracted_cos(c, eta);
  const F f0 = f0_from_ior(eta);
  const F r = fma(F(1.f - f0), schlick_weight(select(eta < 1.f, t, c)), f0);
  return {r, t};
}

/// Returns the exact reflectance or Schlick's approximation, as the render setting `schlick`
/// selects.
template <typename F>
inline DielectricFresnel<F> fresnel_dielectric(const F& cos_i, const F& eta, bool schlick) {
  return schlick ? fresnel_dielectric_schlick(cos_i, eta) : fresnel_dielectric(cos_i, eta);
}

/// Exact reflectance of a conductor of complex index eta + i k, seen from vacuum (Born and Wolf,
/// 14.2; real form by Lagarde, "Memo on Fresnel equations", 2013).
template <typename F>
inline F fresnel_conductor(const F& cos_i, const F& eta, const F& k) {
  const F c = clamp(cos_i, F(0.f), F(1.f));
  const F c2 = c * c, s2 = 1.f - c2;
  const F eta2 = eta * eta, k2 = k * k;
  const F t0 = eta2 - k2 - s2;
  const F a2_plus_b2 = sqrt(fma(t0, t0, F(4.f * eta2 * k2)));
  const F t1 = a2_plus_b2 + c2;
  const F t2 = 2.f * c * safe_sqrt(F(0.5f * F(a2_plus_b2 + t0)));
  const F rs = F(t1 - t2) / max(F(t1 + t2), F(1e-20f));
  const F t3 = fma(c2, a2_plus_b2, F(s2 * s2));
  const F t4 = t2 * s2;
  const F rp = rs * (F(t3 - t4) / max(F(t3 + t4), F(1e-20f)));
  return clamp(F(0.5f * F(rs + rp)), F(0.f), F(1.f));
}
template <typename F>
inline Color<F> fresnel_conductor(const F& cos_i, const Color<F>& eta, const Color<F>& k) {
  return {fresnel_conductor(cos_i, eta.x, k.x), fresnel_conductor(cos_i, eta.y, k.y),
          fresnel_conductor(cos_i, eta.z, k.z)};
}

/// Schlick's formula with an edge tint: F(c) = F0 + (1 - F0)(1 - c)^5 - b c (1 - c)^6, where b is
/// such that F(1/7) = tint * Schlick(1/7), at about 82 degrees (Kutz, Hasan, Edmondson, "Novel
/// Aspects of the Adobe Standard Material", 2021; Hoffman, "Fresnel Equations Considered Harmful",
/// 2019).
template <typename F>
struct F82Tint {
  Color<F> f0, b;

  F82Tint() = default;
  F82Tint(const Color<F>& f0_, const Color<F>& tint) : f0(f0_) {
    // inverse of c (1 - c)^6 at c = 1/7
    constexpr float kInvLazanyi = 17.6513846f;
    const Color<F> at_82 = fresnel_schlick(f0, F(F(1.f / 7.f)));
    b = at_82 * Color<F>(Color<F>(F(1.f)) - tint) * F(kInvLazanyi);
  }

  Color<F> operator()(const F& cos_i) const {
    const F c = clamp(cos_i, F(0.f), F(1.f));
    const F m = 1.f - c;
    const F m2 = m * m;
    const F m5 = m2 * m2 * m;
    const F dip = c * m5 * m;
    const Color<F> f = fma(b, F(-dip), lerp(f0, Color<F>(F(1.f)), m5));
    return max(min(f, Color<F>(F(1.f))), Color<F>(F(0.f)));
  }

  /// Mean over the cosine-weighted hemisphere: 2 int F(c) c dc = F0 + (1 - F0) / 21 - b / 126.
  Color<F> average() const {
    const Color<F> f = fma(b, F(-1.f / 126.f), lerp(f0, Color<F>(F(1.f)), F(1.f / 21.f)));
    return max(min(f, Color<F>(F(1.f))), Color<F>(F(0.f)));
  }
};

}  // namespace wavecomb
