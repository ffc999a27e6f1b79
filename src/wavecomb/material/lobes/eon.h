// SPDX-License-Identifier: Apache-2.0
/// Energy-preserving rough diffuse reflection (Portsmouth, Kutz, Hill, "EON: A Practical
/// Energy-Preserving Rough Diffuse BRDF", 2024).
#pragma once

#include "wavecomb/core/math.h"
#include "wavecomb/core/warp.h"

namespace wavecomb {

/// Rotation about the z axis into the frame whose xz plane contains the direction `w`.
template <typename F>
struct AzimuthFrame {
  F c, s;

  explicit AzimuthFrame(const Vec3<F>& w) {
    const F r2 = fma(w.x, w.x, F(w.y * w.y));
    const Mask<F> tilted = r2 > 1e-14f;
    const F inv = 1.f / sqrt(select(tilted, r2, F(1.f)));
    c = select(tilted, F(w.x * inv), F(1.f));
    s = select(tilted, F(w.y * inv), F(0.f));
  }
  Vec3<F> to(const Vec3<F>& v) const {
    return {fma(c, v.x, F(s * v.y)), fma(c, v.y, F(-(s * v.x))), v.z};
  }
  Vec3<F> from(const Vec3<F>& v) const {
    return {fma(c, v.x, F(-(s * v.y))), fma(s, v.x, F(c * v.y)), v.z};
  }
};

/// EON diffuse lobe for a roughness in [0, 1], with both directions above the surface. Roughness 0
/// is Lambertian. With a white colour the directional albedo is 1: the fit E of single scattering
/// is used both in the multiple-scattering lobe and in its normalisation. The error of this fit is
/// below 0.1 %.
template <typename F>
struct EonDiffuse {
  F roughness, a, average;  ///< coefficient A of Fujii's model, and its mean albedo

  EonDiffuse() = default;
  explicit EonDiffuse(const F& r) : roughness(r) {
    constexpr float kC1 = 0.5f - 2.f / (3.f * kPi), kC2 = 2.f / 3.f - 28.f / (15.f * kPi);
    a = 1.f / fma(r, F(kC1), F(1.f));
    average = a * fma(r, F(kC2), F(1.f));
  }

  /// Single-scattering albedo of a white surface for cosine z (eq. 15 and its fit).
  F single_albedo(const F& z) const {
    const F m = 1.f - z;
    F p = fma(m, F(0.0714429953f), F(-0.332181442f));
    p = fma(p, m, F(0.491881867f));
    p = fma(p, m, F(0.0571085289f));
    return fma(roughness, F(m * p), F(1.f)) * a;
  }

  /// Colour of light that leaves after more than one bounce between microfacets.
  Color<F> multiple(const Color<F>& rho) const {
    const auto one = [this](const F& r) {
      return F(F(r * r * average) / fnma(r, F(1.f - average), F(1.f)));
    };
    return {one(rho.x), one(rho.y), one(rho.z)};
  }

  /// f |cos theta_i| for the colour rho; 0 if either direction is below the surface.
  Color<F> eval(const Color<F>& rho, const Vec3<F>& wo, const Vec3<F>& wi) const {
    const F s = dot(wo, wi) - F(wo.z * wi.z);
    const F lower = max(max(wo.z, wi.z), F(1e-6f));
    const F shape = select(s > 0.f, F(s / lower), s);
    const F single = a * max(fma(roughness, shape, F(1.f)), F(0.f));
    const F lost_o = max(F(1.f - single_albedo(wo.z)), F(1e-7f));
    const F lost_i = max(F(1.f - single_albedo(wi.z)), F(1e-7f));
    const F again = F(lost_o * lost_i) / max(F(1.f - average), F(1e-7f));
    const F cosine = select((wo.z > 0.f) & (wi.z > 0.f), F(max(wi.z, F(0.f)) * kInvPi), F(0.f));
    return fma(multiple(rho), again, rho * single) * cosine;
  }

  /// Directional albedo for cosine z.
  Color<F> albedo(const Color<F>& rho, const F& z) const {
    const F e = single_albedo(z);
    return fma(multiple(rho), F(1.f - e), rho * e);
  }

  /// Sampling parameters: a clipped linearly transformed cosine, mixed with the uniform hemisphere
  /// (section 5).
  struct Sampler {
    F a, b, c, d, det, s, uniform;
  };
  Sampler sampler(const F& z) const {
    const F r = roughness, mu = clamp(z, F(0.f), F(1.f));
    Sampler t;
    t.a = fma(r,
              F(fma(fma(F(0.111709f), mu, F(-0.518982f)), mu, F(0.303392f)) +
                fma(F(0.335918f), mu, F(-0.276266f)) * r),
              F(1.f));
    t.b = r * F(fma(F(1.15859f), mu, F(-1.16407f)) + fma(F(-0.150105f), mu, F(0.150815f)) * r) /
          F(mu * mu * mu - 1.43545f);
    t.c = fma(r, fma(fma(F(0.261777f), mu, F(-0.506373f)), mu, F(0.20013f)), F(1.f));
    t.d = r * fma(fma(F(0.475392f), mu, F(-1.01625f)), mu, F(0.540852f)) /
          fma(F(mu + 0.0725628f), mu, F(-1.0743f));
    t.det = t.c * F(t.a - t.b * t.d);
    t.s = 0.5f * F(1.f + 1.f / sqrt(fma(t.d, t.d, F(1.f))));
    const F share =
        fma(fma(fma(F(-0.290822f), mu, F(0.538233f)), mu, F(-0.372058f)), mu, F(0.162925f));
    t.uniform = clamp(F(pow(r, F(0.1f)) * share), F(0.f), F(1.f));
    return t;
  }

  /// Density of `sample`; 0 below the surface.
  F pdf(const Sampler& t, const Vec3<F>& wo, const Vec3<F>& wi_) const {
    const Vec3<F> wi = AzimuthFrame<F>(wo).to(wi_);
    const F skew = t.a - t.b * t.d;
    const Vec3<F> h(F(t.c * fnma(t.b, wi.z, wi.x)), F(skew * wi.y),
                    F(-t.c * fma(t.d, wi.x, F(-(t.a * wi.z)))));
    const F len2 = max(length_squared(h), F(1e-20f));
    const F ltc = sqr(F(t.det / len2)) * max(h.z, F(0.f)) * F(kInvPi / t.s);
    const F mixed = fma(t.uniform, F(kInv2Pi - ltc), ltc);
    return select((wo.z > 0.f) & (wi.z > 0.f), mixed, F(0.f));
  }

  /// Samples a direction from three sample values in [0, 1).
  Vec3<F> sample(const Sampler& t, const Vec3<F>& wo, const F& choice, const F& u,
                 const F& v) const {
    const auto [sine, cosine] = sincos_2pi(v);
    const F radius = sqrt(u);
    const F y = radius * sine;
    const F edge = safe_sqrt(fnma(y, y, F(1.f)));
    const F x = -fma(F(F(radius * cosine) - edge), t.s, edge);
    const F z = safe_sqrt(fnma(x, x, fnma(y, y, F(1.f))));
    const Vec3<F> turned(fma(t.a, x, F(t.b * z)), F(t.c * y), fma(t.d, x, z));
    const F len2 = length_squared(turned);
    const Mask<F> valid = len2 > 1e-20f;
    const Vec3<F> ltc =
        AzimuthFrame<F>(wo).from(turned) * F(1.f / sqrt(select(valid, len2, F(1.f))));
    const F sin_u = safe_sqrt(fnma(u, u, F(1.f)));
    const Vec3<F> flat(F(sin_u * cosine), F(sin_u * sine), u);
    const Vec3<F> up(F(0.f), F(0.f), F(1.f));
    return select<F>(choice < t.uniform, flat, select<F>(valid, ltc, up));
  }
};

}  // namespace wavecomb
