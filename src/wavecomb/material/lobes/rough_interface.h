// SPDX-License-Identifier: Apache-2.0
/// Directional albedo of a rough dielectric interface, which determines the light that reaches a
/// base below it.
#pragma once

#include "wavecomb/material/lobes/coat.h"
#include "wavecomb/material/lobes/multiple_scattering.h"

namespace wavecomb {

/// Directional albedo of one bounce off a GGX interface whose microfacets reflect f0 + (1 - f0)
/// w(c), w as in CoatFresnel:
///   E(z) = f0 (1 - L(z)) + (1 - f0) W(z),   L from LostEnergy,
///   W(z) = int w(o.h) G2 / G1 over the visible normals for cosine z = w(z_e).
/// Visible microfacets face the viewer more than the surface does, so a rough interface reflects
/// less at grazing angles than a smooth one: 0.16 instead of 0.34 at z = 0.2, index 1.5 and alpha =
/// 0.2.
///
/// The effective cosine z_e = z + alpha P(x, roughness, index), x = z / (z + 0.4 alpha), is a
/// polynomial fitted to numerical integrals for exact reflectances of indices from 1.05 to 3 and
/// for Schlick's formula. The fit tends to overestimate: for alpha >= 0.01 and z >= 0.02, W lies at
/// most 0.007 below the integrals and 0.012 above them. A smooth interface has z_e = z and L = 0.
template <typename F>
struct RoughInterface {
  RoughInterface() = default;
  RoughInterface(const CoatFresnel<F>& fresnel, const F& roughness, const F& alpha,
                 const LostEnergy<F>& lost, const Mask<F>& smooth)
      : fresnel_(fresnel), alpha_(select(smooth, F(0.f), alpha)) {
    const F ior = fresnel.ior;
    const F x = min(F(F(ior - 1.f) / F(ior + 1.f)), F(0.5f));
    const F r = fma(roughness, F(2.f), F(-1.f));
    const Mask<F> has_schlick = fresnel.exact < 1.f;
    const F index = polynomial(x, kIndex);
    for (size_t i = 0; i < kTerms; ++i) {
      coefficients_[i] = fma(index, polynomial(r, kByIndex[i]), polynomial(r, kExact[i]));
      if (any(has_schlick)) {
        const F schlick = polynomial(r, kSchlick[i]);
        const F mixed = fma(fresnel.exact, F(coefficients_[i] - schlick), schlick);
        coefficients_[i] = select(has_schlick, mixed, coefficients_[i]);
      }
    }
    // The ratio of 2 int W c dc to its value for a smooth interface is fitted by 1 / (1 +
    // polynomial)^2.
    F growth(0.f);
    for (size_t j = 5; j-- > 0;) {
      const F exact = polynomial(x, kMean[j]);
      const F c = fma(fresnel.exact, F(exact - kMeanSchlick[j]), F(kMeanSchlick[j]));
      growth = fma(growth, roughness, c);
    }
    growth = fma(growth, roughness, F(1.f));
    const F share = select(smooth, F(1.f), F(1.f / F(growth * growth)));
    average_weight_ = fresnel.average_weight() * share;
    average_lost_ = select(smooth, F(0.f), lost.mean);
  }

  /// Returns W(z), the mean of w over the visible microfacets.
  F weight(const F& z) const {
    const F x = fma(F(z / max(fma(alpha_, F(0.4f), z), F(1e-20f))), F(2.f), F(-1.f));
    F p = coefficients_[kTerms - 1];
    for (size_t i = kTerms - 1; i-- > 0;) p = fma(p, x, coefficients_[i]);
    return fresnel_.weight(clamp(fma(alpha_, p, z), F(0.f), F(1.f)));
  }

  /// Albedo E(z), plus the contribution `back` * L(z) of a multiple-scattering lobe. `lost` is
  /// L(z), or 0 for a smooth interface.
  template <typename C>
  C albedo(const C& f0, const C& back, const F& z, const F& lost) const {
    return clamped(C(mixed(f0, weight(z)) - C(C(f0 - back) * lost)));
  }
  /// Hemispherical mean of the albedo, 2 int albedo(z) z dz.
  template <typename C>
  C average(const C& f0, const C& back) const {
    return clamped(C(mixed(f0, average_weight_) - C(C(f0 - back) * average_lost_)));
  }

 private:
  static F mixed(const F& f0, const F& w) { return fma(F(1.f - f0), w, f0); }
  static Color<F> mixed(const Color<F>& f0, const F& w) { return lerp(f0, Color<F>(F(1.f)), w); }
  static F clamped(const F& x) { return clamp(x, F(0.f), F(1.f)); }
  static Color<F> clamped(const Color<F>& c) {
    return max(min(c, Color<F>(F(1.f))), Color<F>(F(0.f)));
  }
  template <size_t N>
  static F polynomial(const F& x, const float (&c)[N]) {
    F p(c[N - 1]);
    for (size_t i = N - 1; i-- > 0;) p = fma(p, x, F(c[i]));
    return p;
  }

  /// Coefficients of P: rows by powers of 2 x - 1, columns by powers of 2 roughness - 1.
  static constexpr size_t kTerms = 6;
  static constexpr float kExact[kTerms][5] = {
      {0.9266076f, -0.9305411f, 0.7977785f, -0.9539034f, 0.4855576f},
      {-0.4004319f, 0.2979731f, -0.1252724f, -1.6825424f, 1.3784898f},
      {-0.2055699f, 0.1344792f, -1.9485381f, -0.8758247f, 2.6660196f},
      {-0.2120435f, -0.7784132f, -2.9654787f, 4.5759976f, 0.8993006f},
      {-0.8520517f, -1.0105389f, 1.3209972f, 4.3170127f, -1.0808269f},
      {-0.6710762f, -0.2721837f, 2.7463521f, -0.2101072f, -0.2753761f}};
  /// Index-dependent part of P, multiplied by polynomial(x, kIndex) with x = (ior - 1) / (ior + 1).
  static constexpr float kByIndex[kTerms][4] = {{-0.0842379f, 0.0703477f, -0.0585453f, 0.0508931f},
                                                {0.0151965f, -0.0094389f, -0.1220402f, 0.2354345f},
                                                {-0.0243655f, -0.0838729f, 0.1612596f, 0.3183360f},
                                                {-0.0338692f, -0.0542601f, 0.5570281f, -0.1129264f},
                                                {0.1002549f, 0.1759013f, 0.0038015f, -0.3927953f},
                                                {0.1004732f, 0.1706777f, -0.3342187f, -0.1431753f}};
  static constexpr float kIndex[5] = {4.1751180f, -51.7461949f, 234.0208263f, -483.1869650f,
                                      399.2454630f};
  static constexpr float kSchlick[kTerms][5] = {
      {0.8862849f, -1.0557989f, 0.9177688f, -1.1014303f, 0.5973083f},
      {-0.4445082f, 0.2770223f, -0.4257695f, -1.9286374f, 2.2260589f},
      {-0.2234493f, -0.1377455f, -2.6092596f, -0.0964413f, 4.4624892f},
      {-0.2659702f, -1.2259614f, -2.6864402f, 7.5538369f, 1.5607988f},
      {-0.9908347f, -0.8050145f, 3.1506614f, 6.0875536f, -1.6948976f},
      {-0.7599088f, 0.1406918f, 3.9129157f, -0.5094173f, -0.4877852f}};
  /// Coefficients of the mean: rows by powers 1 to 5 of roughness, columns by powers of x.
  static constexpr float kMean[5][3] = {{-0.1069247f, 0.8916114f, -1.6011660f},
                                        {0.5794406f, -15.6900399f, 29.0134264f},
                                        {15.3922461f, 1.7815140f, -14.4212302f},
                                        {-27.4030288f, 31.1818648f, -46.5065030f},
                                        {15.6147817f, -28.2559124f, 48.0157187f}};
  static constexpr float kMeanSchlick[5] = {-0.0410358f, -1.0169002f, 16.2601512f, -26.0863008f,
                                            14.6052899f};

  CoatFresnel<F> fresnel_;
  F alpha_, average_weight_, average_lost_;
  F coefficients_[kTerms];
};

}  // namespace wavecomb
