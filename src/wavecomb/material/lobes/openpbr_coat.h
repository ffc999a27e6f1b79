// SPDX-License-Identifier: Apache-2.0
/// Coat of OpenPBR: a dielectric layer that tints and darkens the layers below.
#pragma once

#include "wavecomb/material/energy_tables.h"
#include "wavecomb/material/lobes/coat.h"
#include "wavecomb/material/lobes/fresnel.h"
#include "wavecomb/material/lobes/ggx.h"
#include "wavecomb/material/openpbr_params.h"

namespace wavecomb {

/// Parameters of the coat that do not depend on directions.
template <typename F>
struct OpenPbrCoat {
  F weight, roughness, ior, f0, darkening;
  /// `half_log` is half the logarithm of `color`, since light crosses the coat twice.
  Color<F> color, half_log;
  Ggx<F> ggx;
  Mask<F> smooth;

  OpenPbrCoat() = default;
  explicit OpenPbrCoat(const OpenPbrParams<F>& p)
      : weight(p.clearcoat),
        roughness(p.clearcoat_roughness),
        ior(coat_ior(p.coat_ior)),
        f0(f0_from_ior(ior)),
        darkening(p.coat_darkening),
        color(p.coat_color) {
    const F alpha = alpha_from_roughness(roughness);
    smooth = alpha < kDeltaAlpha;
    ggx.alpha = max(alpha, F(kDeltaAlpha));
    const auto half = [](const F& c) { return F(0.5f * log(max(c, F(1e-6f)))); };
    half_log = {half(color.x), half(color.y), half(color.z)};
  }

  /// Values of a coat of weight 1 that depend on the viewing direction only.
  struct Layer {
    F compensation;  ///< factor on the coat's reflection that compensates for multiple scattering
    F albedo;        ///< directional albedo, at most 1
  };
  /// Computes the layer for a viewer at cosine `z`; `energy` is the table of energy_tables.h.
  Layer layer(const float* energy, const F& z) const {
    const EnergyLookup<F> lookup(energy, z, roughness);
    const F white = max(lookup.white(), F(1e-3f));
    const F compensation = select(smooth, F(1.f), fma(f0, F(F(1.f - white) / white), F(1.f)));
    const F rough = lookup.reflected(ior) * compensation;
    const F mirror = fresnel_dielectric(z, ior).reflectance;
    return {compensation, min(select(smooth, mirror, rough), F(1.f))};
  }

  /// Transmission colour^(1 / (2 mu)), where mu is the cosine inside the coat for a ray of cosine
  /// `z` outside.
  Color<F> tint(const F& z) const {
    const F inv = 1.f / max(refracted_cos(abs(z), ior), F(0.05f));
    return {exp(F(half_log.x * inv)), exp(F(half_log.y * inv)), exp(F(half_log.z * inv))};
  }

  /// Fresnel reflectance of a microfacet of the coat, multiplied by the coat weight `on` and by the
  /// multiple-scattering factor `compensation`.
  F reflectance(const F& on, const F& compensation, const F& cos_h) const {
    return on * min(F(fresnel_dielectric(cos_h, ior).reflectance * compensation), F(1.f));
  }

  /// Darkening of the base for a viewer at cosine `z`: (1 - K) / (1 - K E_base), because the coat
  /// reflects light back to the base (OpenPBR 1.1, "Coat darkening"). `albedo` is E_base, `spread`
  /// is how diffuse the base is (0 to 1), and `inside` marks lanes whose viewer is inside, where
  /// the base is not darkened.
  Color<F> darkened(const F& z, const Color<F>& albedo, const F& spread,
                    const Mask<F>& inside) const {
    const F mirror = fresnel_dielectric(z, ior).reflectance;
    const F rough = 1.f - F(1.f - average_fresnel_dielectric(ior)) / sqr(ior);
    const F k = fma(spread, F(rough - mirror), mirror);
    const Color<F> e = min(albedo, Color<F>(F(1.f)));
    const auto one = [&](const F& channel) {
      const F dark = F(1.f - k) / max(fnma(k, channel, F(1.f)), F(1e-4f));
      const F on = select(inside, F(0.f), darkening);
      return fma(on, F(dark - 1.f), F(1.f));
    };
    return {one(e.x), one(e.y), one(e.z)};
  }
};

}  // namespace wavecomb
