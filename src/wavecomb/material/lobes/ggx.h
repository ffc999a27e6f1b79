// SPDX-License-Identifier: Apache-2.0
/// Isotropic GGX distribution of microfacet normals with Smith masking and shadowing.
#pragma once

#include "wavecomb/core/math.h"
#include "wavecomb/core/vec.h"

namespace wavecomb {

/// Minimum alpha of a microfacet lobe, a roughness of 0.0316. Lobes with a smaller alpha are delta
/// lobes in eval, sample and pdf, because floats do not resolve directions finely enough.
inline constexpr float kDeltaAlpha = 1e-3f;

/// Converts perceptual roughness to alpha = roughness^2.
template <typename F>
inline F alpha_from_roughness(const F& roughness) {
  return roughness * roughness;
}

/// GGX distribution. Directions are local unit vectors; masking terms use |w.z|, so either side of
/// the surface is allowed.
template <typename F>
struct Ggx {
  F alpha;

  /// D(h) of Walter et al., "Microfacet Models for Refraction through Rough Surfaces", EGSR 2007,
  /// eq. 33. The formula uses slopes, which stay accurate for h.z near 1.
  F d(const Vec3<F>& h) const { return d_along(h, F(1.f)); }
  /// D(h) for the normal h = `sum` / |`sum`|, where `length2` is the squared length of `sum` (s in
  /// the formula):
  ///   (alpha |s|^2 / (alpha^2 s_z^2 + s_x^2 + s_y^2))^2 / pi
  F d_along(const Vec3<F>& sum, const F& length2) const {
    const F r = fma(sum.x, sum.x, F(sum.y * sum.y));
    const F q = fma(F(alpha * alpha), F(sum.z * sum.z), r);
    return sqr(F(F(alpha * length2) / max(q, F(1e-30f)))) * kInvPi;
  }

  /// s(w) = sqrt(z^2 + alpha^2 (x^2 + y^2)) = |z| (1 + 2 Lambda(w)); positive for alpha > 0.
  F s(const Vec3<F>& w) const {
    const F r2 = fma(w.x, w.x, F(w.y * w.y));
    return sqrt(fma(F(alpha * alpha), r2, F(w.z * w.z)));
  }

  /// Masking G1 = 1 / (1 + Lambda) (Walter et al. 2007, eq. 34).
  F g1(const Vec3<F>& w) const {
    const F z = abs(w.z);
    return F(2.f * z) / F(z + s(w));
  }

  /// Height-correlated masking and shadowing, divided by 4 |z_o z_i|, with G2 = 1 / (1 + Lambda(o)
  /// + Lambda(i)) (Heitz, "Understanding the Masking-Shadowing Function", JCGT 3(2) 2014, eq. 99).
  F g2_over_4cos(const Vec3<F>& wo, const Vec3<F>& wi) const {
    return 0.5f / fma(abs(wo.z), s(wi), F(abs(wi.z) * s(wo)));
  }

  /// G2(wo, wi) / G1(wo): the weight of visible-normal samples.
  F g2_over_g1(const Vec3<F>& wo, const Vec3<F>& wi) const {
    const F zo = abs(wo.z), zi = abs(wi.z);
    const F so = s(wo);
    return F(zi * F(zo + so)) / fma(zo, s(wi), F(zi * so));
  }

  /// Density of sample_visible over solid angle of h without the factor (wo . h): G1(wo) D(h) /
  /// z_o.
  F visible_density_over_cos(const Vec3<F>& wo, const Vec3<F>& h) const {
    return F(2.f * d(h)) / F(abs(wo.z) + s(wo));
  }

  /// Samples a visible normal for wo (z >= 0). The stretched wo, reflected by the sampled normal,
  /// is uniform on a spherical cap (Dupuy and Benyoub, "Sampling Visible GGX Normals with Spherical
  /// Caps", HPG 2023, listing 3).
  Vec3<F> sample_visible(const Vec3<F>& wo, const F& u, const F& v) const {
    const Vec3<F> k = normalize(Vec3<F>(alpha * wo.x, alpha * wo.y, wo.z));
    const auto [sin_phi, cos_phi] = sincos_2pi(u);
    // The sampled z on the spherical cap is (1 - v)(1 + k.z) - k.z. The terms 1 - z and z + k.z are
    // computed without cancellation.
    const F cap = 1.f + k.z;
    const F n_z = F(1.f - v) * cap;
    const F z = n_z - k.z;
    const F r = safe_sqrt(F(v * cap * F(1.f + z)));
    const Vec3<F> h(alpha * fma(r, cos_phi, k.x), alpha * fma(r, sin_phi, k.y), n_z);
    const F len2 = length_squared(h);
    const Mask<F> valid = len2 > 1e-30f;
    const F inv = 1.f / sqrt(select(valid, len2, F(1.f)));
    return select<F>(valid, h * inv, Vec3<F>(F(0.f), F(0.f), F(1.f)));
  }
};

/// Reflects wo about the unit vector h.
template <typename F>
inline Vec3<F> reflect(const Vec3<F>& wo, const Vec3<F>& h) {
  return fma(h, F(2.f * dot(wo, h)), Vec3<F>(-wo));
}

}  // namespace wavecomb
