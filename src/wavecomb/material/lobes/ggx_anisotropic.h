// SPDX-License-Identifier: Apache-2.0
/// Anisotropic GGX distribution of microfacet normals.
#pragma once

#include "wavecomb/material/lobes/ggx.h"

namespace wavecomb {

/// GGX distribution with roughness alpha_x along x and alpha_y along y. If alpha_x equals alpha_y,
/// the results equal those of Ggx.
template <typename F>
struct AnisotropicGgx {
  F ax, ay;

  /// D(h) (Heitz, "Understanding the Masking-Shadowing Function", JCGT 3(2) 2014, eq. 85);
  /// numerator and denominator are multiplied by a^4, with a^2 = ax ay.
  F d(const Vec3<F>& h) const {
    const F a2 = ax * ay;
    const F q = fma(F(a2 * h.z), F(a2 * h.z), fma(F(h.x * ay), F(h.x * ay), sqr(F(h.y * ax))));
    return a2 * sqr(F(a2 / max(q, F(1e-30f)))) * kInvPi;
  }
  /// sqrt(z^2 + (ax x)^2 + (ay y)^2) = |z| (1 + 2 Lambda(w)).
  F s(const Vec3<F>& w) const {
    return sqrt(fma(w.z, w.z, fma(F(ax * w.x), F(ax * w.x), sqr(F(ay * w.y)))));
  }
  /// G2 / (4 |z_o z_i|), height-correlated; `so` is s(wo).
  F g2_over_4cos(const Vec3<F>& wo, const F& so, const Vec3<F>& wi) const {
    return 0.5f / max(fma(abs(wo.z), s(wi), F(abs(wi.z) * so)), F(1e-20f));
  }
  /// G2(wo, wi) / G1(wo): the weight of visible-normal samples.
  F g2_over_g1(const Vec3<F>& wo, const Vec3<F>& wi) const {
    const F zo = abs(wo.z), zi = abs(wi.z), so = s(wo);
    return F(zi * F(zo + so)) / max(fma(zo, s(wi), F(zi * so)), F(1e-20f));
  }
  /// Alpha of an isotropic surface whose visible normals have about the same cosines to the viewing
  /// direction `w`. For w.z = 1, this is the root mean square of alpha_x and alpha_y. For w.z = 0,
  /// this is the alpha along the azimuth of `w`.
  F projected_alpha(const Vec3<F>& w) const {
    const F z2 = w.z * w.z;
    const F r2 = max(fma(w.x, w.x, F(w.y * w.y)), F(1e-20f));
    const F x2 = F(w.x * w.x) / r2, ax2 = ax * ax, ay2 = ay * ay;
    const F along = fma(F(ax2 - ay2), x2, ay2), across = F(ax2 + ay2) - along;
    return sqrt(fma(F(across - along), F(0.5f * z2), along));
  }
  /// Samples a visible normal for wo (z >= 0) (Dupuy and Benyoub, "Sampling Visible GGX Normals
  /// with Spherical Caps", HPG 2023).
  Vec3<F> sample_visible(const Vec3<F>& wo, const F& u, const F& v) const {
    const Vec3<F> k = normalize(Vec3<F>(ax * wo.x, ay * wo.y, max(wo.z, F(1e-7f))));
    const auto [sin_phi, cos_phi] = sincos_2pi(u);
    const F cap = 1.f + k.z;
    const F n_z = F(1.f - v) * cap;
    const F z = n_z - k.z;
    const F r = safe_sqrt(F(v * cap * F(1.f + z)));
    const Vec3<F> h(ax * fma(r, cos_phi, k.x), ay * fma(r, sin_phi, k.y), n_z);
    const F len2 = length_squared(h);
    const Mask<F> valid = len2 > 1e-30f;
    const F inv = 1.f / sqrt(select(valid, len2, F(1.f)));
    return select<F>(valid, h * inv, Vec3<F>(F(0.f), F(0.f), F(1.f)));
  }
};

/// Rotation about z. A rotation by an angle of 0 leaves directions bitwise unchanged, including the
/// sign of zero components.
template <typename F>
struct Turn {
  F cos, sin;

  Turn() = default;
  /// `turns` is the angle in units of a full turn.
  explicit Turn(const F& turns) {
    const SinCos<F> turn = sincos_2pi(turns);
    cos = turn.cos;
    sin = turn.sin;
  }
  Vec3<F> to(const Vec3<F>& w) const {
    const Vec3<F> t(fma(cos, w.x, F(sin * w.y)), fma(cos, w.y, F(-(sin * w.x))), w.z);
    return select<F>(sin != 0.f, t, w);
  }
  Vec3<F> back(const Vec3<F>& w) const {
    const Vec3<F> t(fma(cos, w.x, F(-(sin * w.y))), fma(sin, w.x, F(cos * w.y)), w.z);
    return select<F>(sin != 0.f, t, w);
  }
};

}  // namespace wavecomb
