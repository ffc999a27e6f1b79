// SPDX-License-Identifier: Apache-2.0
/// A dielectric coat over a diffuse base: reflectance of the coat, and transmission to the base.
#pragma once

#include "wavecomb/material/lobes/fresnel.h"

namespace wavecomb {

/// Index of refraction of a coat seen from outside. An index below 1 is replaced by its inverse,
/// which has the same reflectance at normal incidence but no total internal reflection.
template <typename F>
inline F coat_ior(const F& ior) {
  return max(ior, F(1.f / ior));
}

/// Mean reflectance 2 int F(c) c dc of a dielectric from outside, for eta in [1, 10]. Least-squares
/// polynomial in (eta - 1) / (eta + 1), at most 9e-4 below the numerical integrals and never above.
template <typename F>
inline F average_fresnel_dielectric(const F& eta) {
  const F x = F(eta - 1.f) / F(eta + 1.f);
  F p = fma(x, F(-3.00870101f), F(8.72975236f));
  p = fma(p, x, F(-9.79925597f));
  p = fma(p, x, F(5.91733056f));
  p = fma(p, x, F(-1.46933587f));
  p = fma(p, x, F(0.58128417f));
  return clamp(fma(p, x, F(-3.3e-4f)), F(0.f), F(1.f));
}

/// Reflectance F0 + (1 - F0) w(c) of a coat with index >= 1. With `exact` = 0, w is Schlick's (1 -
/// c)^5. With `exact` = 1, w follows the exact Fresnel curve: w = (F_exact - f) / (1 - f) with f =
/// F_exact(1). Values of `exact` between 0 and 1 blend the two curves.
template <typename F>
struct CoatFresnel {
  F ior;
  F exact;
  F f0_exact;
  F inverse_ior2, inverse_rest;  ///< 1 / ior^2; 1 / (1 - f)

  CoatFresnel() = default;
  CoatFresnel(const F& ior_, const F& exact_)
      : ior(ior_),
        exact(exact_),
        f0_exact(f0_from_ior(ior_)),
        inverse_ior2(1.f / sqr(ior_)),
        inverse_rest(1.f / F(1.f - f0_exact)) {}

  F weight(const F& cos_i) const {
    const F w = schlick_weight(cos_i);
    if (none(Mask<F>(exact > 0.f))) return w;
    const F c = clamp(cos_i, F(0.f), F(1.f));
    const F t = safe_sqrt(fnma(max(fnma(c, c, F(1.f)), F(0.f)), inverse_ior2, F(1.f)));
    const F r = dielectric_reflectance(c, t, ior);
    const F e = clamp(F(F(r - f0_exact) * inverse_rest), F(0.f), F(1.f));
    return clamp(fma(exact, F(e - w), w), F(0.f), F(1.f));
  }
  /// Returns the mean weight, 2 int w(c) c dc.
  F average_weight() const {
    const F w(1.f / 21.f);
    const F e = F(average_fresnel_dielectric(ior) - f0_exact) * inverse_rest;
    return clamp(fma(exact, F(e - w), w), F(0.f), F(1.f));
  }
  F operator()(const F& f0, const F& cos_i) const { return fma(F(1.f - f0), weight(cos_i), f0); }
  Color<F> operator()(const Color<F>& f0, const F& cos_i) const {
    return lerp(f0, Color<F>(F(1.f)), weight(cos_i));
  }
  F average(const F& f0) const { return fma(F(1.f - f0), average_weight(), f0); }
  Color<F> average(const Color<F>& f0) const {
    return lerp(f0, Color<F>(F(1.f)), average_weight());
  }
};

/// Fraction of a white diffuse base that is visible through a coat with reflectances f_o towards
/// the viewer and f_i towards the light: (1 - f_o)(1 - f_i) / (1 - f_avg). The denominator accounts
/// for interreflection between coat and base, so a white base under a lossless coat keeps all
/// energy (Kelemen and Szirmay-Kalos, "A Microfacet Based Coupled Specular-Matte BRDF Model", 2001,
/// eq. 6).
template <typename F>
inline F coat_transmission(const F& f_o, const F& f_i, const F& f_avg) {
  return F(1.f - f_o) * F(1.f - f_i) / max(F(1.f - f_avg), F(1e-4f));
}

/// Factor of coat_transmission() that does not depend on the light direction: (1 - f_o) / (1 -
/// f_avg).
template <typename F>
inline F coat_view_factor(const F& f_o, const F& f_avg) {
  return F(1.f - f_o) / max(F(1.f - f_avg), F(1e-4f));
}
template <typename F>
inline Color<F> coat_view_factor(const Color<F>& f_o, const Color<F>& f_avg) {
  return {coat_view_factor(f_o.x, f_avg.x), coat_view_factor(f_o.y, f_avg.y),
          coat_view_factor(f_o.z, f_avg.z)};
}

}  // namespace wavecomb
