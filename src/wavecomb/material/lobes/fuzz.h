// SPDX-License-Identifier: Apache-2.0
/// Fuzz: a volumetric layer of fibres, modelled by linearly transformed cosines (Zeltner, Burley,
/// Chiang, "Practical Multiple-Scattering Sheen Using Linearly Transformed Cosines", SIGGRAPH Talks
/// 2022), with the rational fits of its tables published in MaterialX.
#pragma once

#include "wavecomb/material/lobes/eon.h"

namespace wavecomb {

/// f |cos theta_i| = albedo D(wi), where D integrates to 1 and is the density of `sample`. With
/// this normalisation the directional albedo is exactly `albedo`, and sample weights are constant.
/// The lobe depends on the view direction and is not reciprocal.
template <typename F>
struct FuzzLobe {
  F albedo, inv_a, inv_b;

  FuzzLobe() = default;
  /// Computes the lobe for a viewer at cosine `z` and a roughness in [0, 1].
  FuzzLobe(const F& z, const F& roughness) {
    const F x = clamp(z, F(0.f), F(1.f)), y = clamp(roughness, F(0.01f), F(1.f));
    const F s = y * fma(y, F(1.58491f), F(0.0206607f)) / fma(F(y + 1.32227f), y, F(0.0379424f));
    const F m =
        y * fma(fma(fma(F(y * y), F(-0.95943f), F(1.7932f)), y, F(-1.14885f)), y, F(-0.193854f)) /
        F(y + 0.046391f);
    const F o = y * fma(fma(F(0.119681f), y, F(-0.0207818f)), y, F(0.000654023f)) /
                fma(F(y - 1.92021f), y, F(1.26264f));
    const F t = F(x - m) / s;
    const F gauss = exp(F(-0.5f * t * t)) / F(s * 2.50662827463f);
    albedo = clamp(F(gauss + o), F(0.f), F(1.f));
    inv_a = max(F(fma(F(2.58126f), x, F(0.813703f * y)) * y /
                  fma(F(0.310327f * x), x, fma(F(2.60994f * x), y, F(1.f)))),
                F(1e-4f));
    inv_b = safe_sqrt(F(1.f - x)) * F(y - 1.f) * F(y * y * y) /
            fma(fma(F(-1.71506f), y, F(1.71228f)), x, fma(F(1.34174f * y), y, F(2.54053e-5f)));
  }

  /// Density D of a direction; 0 below the surface.
  F density(const Vec3<F>& wo, const Vec3<F>& wi_) const {
    const Vec3<F> wi = AzimuthFrame<F>(wo).to(wi_);
    const Vec3<F> h(fma(inv_a, wi.x, F(inv_b * wi.z)), F(inv_a * wi.y), wi.z);
    const F len2 = max(length_squared(h), F(1e-20f));
    const F d = max(wi.z, F(0.f)) * sqr(F(inv_a / len2)) * kInvPi;
    return select((wo.z > 0.f) & (wi.z > 0.f), d, F(0.f));
  }

  Vec3<F> sample(const Vec3<F>& wo, const F& u, const F& v) const {
    const Vec3<F> h = square_to_cosine_hemisphere(u, v);
    const F a = 1.f / inv_a;
    const Vec3<F> w(F(fnma(h.z, inv_b, h.x) * a), F(h.y * a), h.z);
    return AzimuthFrame<F>(wo).from(normalize(w));
  }
};

}  // namespace wavecomb
