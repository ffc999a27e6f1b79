// SPDX-License-Identifier: Apache-2.0
/// The coat of OpenPBR: a dielectric layer that colours and darkens what is below it.
#pragma once

#include "wavecomb/material/energy_tables.h"
#include "wavecomb/material/lobes/coat.h"
#include "wavecomb/material/lobes/fresnel.h"
#include "wavecomb/material/lobes/ggx.h"
#include "wavecomb/material/openpbr_params.h"

namespace wavecomb {

template <typename F>
struct OpenPbrCoat {
  F weight, roughness, ior, f0, darkening;
  Color<F> color, half_log;  ///< half_log: of the colour; light crosses the coat twice
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

  /// What of a coat of weight 1 depends on the direction to the viewer alone.
  struct Layer {
    F compensation;  ///< factor of its reflection, for energy that one bounce loses
    F albedo;        ///< at most 1
  };
  /// Seen at cosine `z`. `energy`: energy_tables.h.
  Layer layer(const float* energy, const F& z) const {
    const EnergyLookup<F> look(energy, z, roughness);
    const F white = max(look.white(), F(1e-3f));
    const F compensation = select(smooth, F(1.f), fma(f0, F(F(1.f - white) / white), F(1.f)));
    const F rough = look.reflected(ior) * compensation;
    const F mirror = fresnel_dielectric(z, ior).reflectance;
    return {compensation, min(select(smooth, mirror, rough), F(1.f))};
  }

  /// color^(1 / 2 mu), mu the cosine in the coat of a ray whose cosine outside is `z`.
  Color<F> tint(const F& z) const {
    const F inv = 1.f / max(refracted_cos(abs(z), ior), F(0.05f));
    return {exp(F(half_log.x * inv)), exp(F(half_log.y * inv)), exp(F(half_log.z * inv))};
  }

  /// Fresnel reflectance of a coat of weight `on` at a facet.
  F reflectance(const F& on, const F& compensation, const F& cos_h) const {
    return on * min(F(fresnel_dielectric(cos_h, ior).reflectance * compensation), F(1.f));
  }

  /// Factor of the base's colour, seen at cosine `z`: the coat sends light back down to the base,
  /// which absorbs again, (1 - K) / (1 - K E_base) (OpenPBR 1.1, "Coat darkening"). `albedo` is
  /// E_base, `spread` how diffuse the base is, `inside` where it is seen from within.
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
