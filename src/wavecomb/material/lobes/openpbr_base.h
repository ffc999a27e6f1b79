// SPDX-License-Identifier: Apache-2.0
/// OpenPBR's base: one rough interface that mixes metal, a glossy-diffuse dielectric and a
/// transmissive dielectric.
#pragma once

#include "wavecomb/material/description/variants.h"
#include "wavecomb/material/energy_tables.h"
#include "wavecomb/material/lobes/coat.h"
#include "wavecomb/material/lobes/ggx_anisotropic.h"
#include "wavecomb/material/lobes/rough_dielectric.h"
#include "wavecomb/material/lobes/thin_film.h"
#include "wavecomb/material/openpbr_params.h"

namespace wavecomb {

/// Importance of a colour in lobe selection: the mean of luminance and maximum component, which
/// bounds sample weights for saturated colours.
template <typename F>
inline F importance(const Color<F>& c) {
  return 0.5f * F(luminance(c) + max_component(c));
}

/// G2 / G1 for the directions that a microfacet reflects (`up`) and refracts (`down`). Both ratios
/// are 1 by default.
template <typename F>
struct FacetMasking {
  F up = F(1.f), down = F(1.f);
};

/// Reflection and transmission colours of a microfacet.
template <typename F>
struct OpenPbrFacet {
  Color<F> reflect, transmit;
  FacetMasking<F> masking;

  /// Probability of sampling reflection at this microfacet.
  F reflect_share() const {
    const F up = importance(reflect) * masking.up, down = importance(transmit) * masking.down;
    return select(down > 0.f, F(up / max(F(up + down), F(1e-20f))), F(1.f));
  }
};

/// Evaluates and samples the base. A visible normal is sampled, then reflection or transmission
/// with probabilities p_R and p_T in proportion to their colours at the microfacet:
///   reflection    f cos = R(h) D G2 / (4 z_o),                      pdf = p_R D G1 / (4 z_o);
///   transmission  f cos = T(h) D G2 |wi.h wo.h| / (z_o c^2 eta^2),
///                 pdf = p_T D G1 |wi.h wo.h| / (z_o c^2),           c = wi.h + wo.h / eta
/// (Walter et al. 2007). Thin walls transmit light through a mirrored copy of the reflection lobe.
///
/// Multiple scattering is compensated by scaling (Turquin 2019): metals by 1 + F0 (1 - E) / E,
/// transmission by 1 / (E_R + E_T).
///
/// E_R + E_T is not tabulated for thin films, anisotropic surfaces, and interfaces whose
/// reflectance does not follow from their index (specular_weight). In these cases, reflection and
/// transmission of each microfacet are scaled by s / (R g_R + (1 - R) g_T), with g = G2 / G1 of the
/// respective direction. s is the same sum for the bare isotropic interface, whose E_R + E_T is
/// tabulated. A film therefore changes the ratio of reflection to transmission but not their sum.
/// For anisotropic surfaces s = 1, without further compensation.
template <typename F, uint32_t kParts = kAllParts>
struct OpenPbrBase {
  static constexpr bool kGlass = (kParts & kTransmissionPart) != 0,
                        kFilm = (kParts & kFilmPart) != 0, kBrush = (kParts & kAnisotropyPart) != 0;
  F metal, opaque, glass;  ///< weights of metal, glossy-diffuse base and glass, whose sum is 1
  F roughness;
  AnisotropicGgx<F> ggx;
  Mask<F> smooth, thin, present;
  F ior;        ///< index that refracts
  F glass_ior;  ///< index that determines reflectance, modified by specular_weight
  F gloss_ior;  ///< index of the interface over the diffuse base, relative to a coat above; >= 1
  F glass_f0, specular_weight;
  Color<F> specular_color, tint;
  F82Tint<F> metal_fresnel;
  ThinFilm<F> film;

  explicit OpenPbrBase(const OpenPbrParams<F>& p) {
    const F coat = p.clearcoat;
    metal = p.metallic;
    opaque = F(1.f - metal);
    glass = F(0.f);
    if constexpr (kGlass) {
      glass = F(1.f - metal) * p.transmission_weight;
      opaque = F(1.f - metal) * F(1.f - p.transmission_weight);
    }
    // A rough coat broadens the base's lobe (OpenPBR, "Coat roughening").
    const F r4 = sqr(F(p.roughness * p.roughness));
    roughness = p.roughness;
    if constexpr ((kParts & kCoatPart) != 0) {
      const F c4 = sqr(F(p.clearcoat_roughness * p.clearcoat_roughness));
      const F rougher = sqrt(sqrt(min(fma(c4, F(2.f), r4), F(1.f))));
      roughness = select(coat > 0.f, fma(coat, F(rougher - p.roughness), p.roughness), p.roughness);
    }
    const F alpha = roughness * roughness;
    const F narrow = 1.f - p.anisotropy;
    const F along = min(F(alpha * sqrt(F(2.f / fma(narrow, narrow, F(1.f))))), F(1.f));
    ggx.ax = max(along, F(kDeltaAlpha));
    ggx.ay = max(F(along * narrow), F(kDeltaAlpha));
    thin = p.thin_walled > 0.5f;
    ior = p.ior;
    smooth =
        (alpha < kDeltaAlpha) | (not_(thin) & (glass > 0.f) & (alpha * abs(F(ior - 1.f)) < 1e-4f));
    specular_weight = p.specular_weight;
    specular_color = p.specular_color;
    tint = p.transmission_tint;
    glass_ior = scaled_ior(ior);
    glass_f0 = f0_from_ior(glass_ior);
    F under = ior;
    if constexpr ((kParts & kCoatPart) != 0)
      under = select(coat > 0.f, F(ior / fma(coat, F(p.coat_ior - 1.f), F(1.f))), ior);
    gloss_ior = scaled_ior(max(under, F(1.f / under)));
    metal_fresnel = F82Tint<F>(p.base_color, p.specular_color);
    film = {p.film_weight, p.film_thickness, p.film_ior};
    present = (metal > 0.f) | (glass > 0.f) | ((opaque > 0.f) & (specular_weight > 0.f));
  }

  Color<F> metal_f0() const { return metal_fresnel.f0 * min(specular_weight, F(1.f)); }

  /// Values that depend on wo only.
  struct View {
    Mask<F> inside;
    Mask<F> brushed;   ///< anisotropic: alpha_x != alpha_y
    Mask<F> by_facet;  ///< lanes that compensate transmission separately for each microfacet
    F eta;             ///< relative index across the surface
    F s, g1;           ///< masking of wo: AnisotropicGgx::s, and G1 / (4 z_o)
    F glass_scale;     ///< multiple-scattering compensation
    F gloss_scale;
    Color<F> metal_scale;
    Color<F> gloss;   ///< albedo of the interface over the diffuse base
    Color<F> kept;    ///< fraction of the transmission that ray traversal leaves to the BSDF
    Color<F> albedo;  ///< estimate of reflection plus transmission
  };

  /// Computes the view. `o` is the viewing direction wo, mirrored to z >= 0. `below` marks lanes
  /// whose viewer is on the inner side of the surface.
  View view(const Vec3<F>& o, const Mask<F>& below, const float* energy) const {
    View v;
    const F z = o.z;
    v.inside = v.brushed = v.by_facet = Mask<F>(false);
    v.eta = ior;
    v.s = ggx.s(o);
    v.g1 = 0.5f / max(F(abs(z) + v.s), F(1e-20f));
    if constexpr (kGlass) {
      v.inside = below & (glass > 0.f) & not_(thin);
      v.eta = select(v.inside, F(1.f / ior), ior);
    }
    if constexpr (kBrush) v.brushed = (ggx.ax != ggx.ay) & not_(smooth);
    if constexpr (kGlass)
      v.by_facet = (v.brushed | (film.weight > 0.f) | (glass_ior != ior)) & (glass > 0.f) &
                   not_(thin) & not_(smooth);
    F alpha = sqrt(F(ggx.ax * ggx.ay));
    if (kBrush && any(v.brushed)) alpha = select(v.brushed, ggx.projected_alpha(o), alpha);
    const EnergyLookup<F> lookup(energy, z, sqrt(alpha));
    F one_bounce = lookup.white(), glossy = lookup.reflected(gloss_ior);
    if (kBrush && any(v.brushed)) {
      // Add the difference between anisotropic and isotropic albedo at the tabulated index.
      const BrushedLookup<F> brush(energy, o, ggx.ax, ggx.ay);
      constexpr float kIndex = EnergyTables::kBrushedIndex;
      const F more = brush.reflected() - lookup.reflected(F(kIndex));
      const F brushed = fma(more, F(F(1.f - f0_from_ior(gloss_ior)) * (1.f / 0.96f)), glossy);
      one_bounce = select(v.brushed, brush.white(), one_bounce);
      glossy = select(v.brushed, max(brushed, F(0.f)), glossy);
    }
    const F white = select(smooth, F(1.f), max(one_bounce, F(1e-3f)));
    const F lost = F(1.f - white) / white;
    const Color<F> one(F(1.f));
    v.metal_scale = one + metal_fresnel.f0 * lost;
    v.gloss_scale = fma(f0_from_ior(gloss_ior), lost, F(1.f));
    v.glass_scale = F(1.f);
    v.kept = one;
    if (kGlass && any(Mask<F>(glass > 0.f))) {
      const F scattered = select(thin, white, max(lookup.scattered(v.eta), F(1e-3f)));
      v.glass_scale = select(smooth | (v.brushed & not_(thin)), F(1.f), F(1.f / scattered));
    }
    const F mirror = fresnel_dielectric(z, gloss_ior).reflectance;
    const F rough = glossy * v.gloss_scale;
    const F gloss = min(select(smooth, mirror, rough), F(1.f));
    v.gloss = Color<F>(gloss);
    if (kFilm && any(Mask<F>(film.weight > 0.f)))
      v.gloss = lerp(v.gloss, filmed_gloss(v, z, lookup), film.weight);
    v.albedo = albedo_of(facet(v, z));
    return v;
  }

  /// Subtracts what ray traversal transmits from what clear walls transmit straight, `passed`.
  /// `most` is most_passing(). The rest depends on the view only, so that all techniques compute
  /// the same densities. A rest of rounding errors is ignored.
  [[gnu::noinline, gnu::cold]] void keep_rest(const Color<F>& passed, const F& most,
                                              const Mask<F>& clear, const F& z, View& v) const {
    const Color<F> rest = passed - Color<F>(passing_probability<F>(passed, most));
    const Mask<F> real = max_component(rest) > F(1e-5f * max_component(passed));
    const Color<F> whole = max(passed, Color<F>(F(1e-20f)));
    const Color<F> kept{rest.x / whole.x, rest.y / whole.y, rest.z / whole.z};
    v.kept = select<F>(clear, select<F>(real, kept, Color<F>(F(0.f))), Color<F>(F(1.f)));
    v.albedo = albedo_of(facet(v, z));
  }

  static Color<F> albedo_of(const OpenPbrFacet<F>& f) {
    return min(Color<F>(f.reflect + f.transmit), Color<F>(F(1.f)));
  }

  /// Colours of a microfacet seen at cosine c, including compensation.
  OpenPbrFacet<F> facet(const View& v, const F& c,
                        const FacetMasking<F>& masking = FacetMasking<F>()) const {
    const Color<F> one(F(1.f));
    const Mask<F> filmed = film.weight > 0.f;
    Color<F> m = metal_fresnel(c);
    Color<F> d(fresnel_dielectric(c, gloss_ior).reflectance);
    if (kFilm && any(filmed)) {
      m = lerp(m, film.over_metal(c, m), film.weight);
      d = lerp(d, film.over_dielectric(c, gloss_ior), film.weight);
    }
    const Color<F> metallic = m * v.metal_scale * F(metal * min(specular_weight, F(1.f)));
    OpenPbrFacet<F> f{metallic + specular_color * d * F(opaque * v.gloss_scale), Color<F>(F(0.f)),
                      masking};
    if (kGlass && any(Mask<F>(glass > 0.f))) {
      const F refracted = refracted_cos(c, v.eta);
      const F outer = select(v.inside, refracted, c);
      const Mask<F> total = not_(thin) & not_(Mask<F>(refracted > 0.f));
      Color<F> g(fresnel_dielectric(outer, glass_ior).reflectance);
      if (kFilm && any(filmed)) {
        // Keep reflection and transmission above 0, so that each microfacet has a direction to
        // sample.
        const Color<F> r = film.over_dielectric(outer, glass_ior);
        const Color<F> least(F(1e-3f));
        g = lerp(g, min(max(r, least), Color<F>(one - least)), film.weight);
      }
      g = select<F>(total, one, g);
      // Sum of the interreflections between the two faces of a thin wall.
      const Color<F> wall(wall_of(g.x), wall_of(g.y), wall_of(g.z));
      g = select<F>(thin, wall, g);
      Color<F> scale(F(glass * v.glass_scale));
      if (kGlass && any(v.by_facet)) {
        const F bare = select(total, F(1.f), fresnel_dielectric(outer, ior).reflectance);
        const auto sum = [&masking](const F& r) {
          return fma(r, masking.up, F(F(1.f - r) * masking.down));
        };
        const F whole = select(v.brushed, F(1.f), sum(bare));
        const auto scale_factor = [&](const F& r) { return F(whole / max(sum(r), F(1e-7f))); };
        scale = select<F>(v.by_facet,
                          scale * Color<F>(scale_factor(g.x), scale_factor(g.y), scale_factor(g.z)),
                          scale);
      }
      f.reflect += specular_color * g * scale;
      f.transmit = tint * Color<F>(one - g) * scale * v.kept;
    }
    return f;
  }

  /// G2 / G1 for a microfacet that reflects wo to `up` and, for transmission, refracts it to
  /// `down`.
  FacetMasking<F> masking_of(const View& v, const Vec3<F>& wo, const Vec3<F>& up,
                             const Vec3<F>& down) const {
    const F g_up = select(up.z > 0.f, ggx.g2_over_g1(wo, up), F(0.f));
    const F g_down = select(down.z < 0.f, ggx.g2_over_g1(wo, down), F(0.f));
    return {select(v.by_facet, g_up, F(1.f)), select(v.by_facet, g_down, F(1.f))};
  }

  /// Scaling of radiance across a refracting interface, 1 / eta^2; 1 for thin walls.
  F radiance_scale(const View& v) const { return select(thin, F(1.f), F(1.f / sqr(v.eta))); }

  BsdfEval<F> eval(const View& v, const Vec3<F>& wo, const Vec3<F>& wi) const {
    if constexpr (!kGlass) return eval_reflection(v, wo, wi);
    const Mask<F> up = wi.z > 0.f;
    const Mask<F> bends = not_(up) & not_(thin);
    const Vec3<F> i(wi.x, wi.y, select(bends, wi.z, abs(wi.z)));
    const Vec3<F> sum = fma(i, select(bends, v.eta, F(1.f)), wo);
    const F len2 = length_squared(sum);
    const Mask<F> nonzero = (len2 > 1e-20f) & (wi.z != 0.f) & (wo.z > 0.f) & (up | (glass > 0.f));
    const F inv_len = 1.f / sqrt(select(nonzero, len2, F(1.f)));
    const Vec3<F> h = sum * F(inv_len * copysign(F(1.f), sum.z));
    const F oh = dot(wo, h), ih = dot(i, h);
    const Mask<F> valid = nonzero & not_(smooth) & (oh > 0.f) & (h.z > 0.f) &
                          ((bends & (ih < 0.f)) | (not_(bends) & (ih > 0.f)));
    const F d = ggx.d(select<F>(valid, h, Vec3<F>(F(0.f), F(0.f), F(1.f))));
    const F c = ih + F(oh / v.eta);
    const F jacobian = select(bends, F(F(-4.f * ih * oh) / max(F(c * c), F(1e-20f))), F(1.f));
    const F base = select(valid, F(d * jacobian), F(0.f));
    const F g2 = ggx.g2_over_4cos(wo, v.s, i) * abs(wi.z);
    const F oc = clamp(oh, F(0.f), F(1.f));
    FacetMasking<F> masking;
    if (kGlass && any(v.by_facet)) {
      const F t = refracted_cos(oc, v.eta);
      const Vec3<F> other = select<F>(up, refract(wo, h, oc, t, v.eta), reflect(wo, h));
      // refract is undefined under total internal reflection.
      const Vec3<F> none(F(0.f), F(0.f), F(1.f));
      const Vec3<F> down = select<F>(up, select<F>(t > 0.f, other, none), i);
      masking = masking_of(v, wo, select<F>(up, i, other), down);
    }
    const OpenPbrFacet<F> f = facet(v, oc, masking);
    const F share = f.reflect_share();
    const Color<F> color = select<F>(up, f.reflect, f.transmit * radiance_scale(v));
    return {color * F(base * g2), F(base * v.g1) * select(up, share, F(1.f - share))};
  }

  /// Version of eval() for program variants without transmission.
  BsdfEval<F> eval_reflection(const View& v, const Vec3<F>& wo, const Vec3<F>& wi) const {
    const Vec3<F> sum = wi + wo;
    const F len2 = length_squared(sum);
    const Mask<F> nonzero = (len2 > 1e-20f) & (wi.z > 0.f) & (wo.z > 0.f);
    const F inv_len = 1.f / sqrt(select(nonzero, len2, F(1.f)));
    const Vec3<F> h = sum * inv_len;
    const F oh = dot(wo, h), ih = dot(wi, h);
    const Mask<F> valid = nonzero & not_(smooth) & (oh > 0.f) & (h.z > 0.f) & (ih > 0.f);
    const F d = ggx.d(select<F>(valid, h, Vec3<F>(F(0.f), F(0.f), F(1.f))));
    const F base = select(valid, d, F(0.f));
    const F g2 = ggx.g2_over_4cos(wo, v.s, wi) * abs(wi.z);
    const OpenPbrFacet<F> f = facet(v, clamp(oh, F(0.f), F(1.f)));
    return {f.reflect * F(base * g2), F(base * v.g1)};
  }

  struct Sample {
    Vec3<F> wi;
    Mask<F> crosses;
  };
  /// Samples a direction. The direction may lie on the wrong side of the surface, where eval
  /// returns 0.
  Sample sample(const View& v, const Vec3<F>& wo, const F& choice, const F& u, const F& w) const {
    Vec3<F> h(F(0.f), F(0.f), F(1.f));
    if (!all(smooth)) h = select<F>(smooth, h, ggx.sample_visible(wo, u, w));
    const F c = clamp(dot(wo, h), F(0.f), F(1.f));
    const Vec3<F> mirrored = reflect(wo, h);
    FacetMasking<F> masking;
    if (kGlass && any(v.by_facet)) {
      const F t = refracted_cos(c, v.eta);
      const Vec3<F> none(F(0.f), F(0.f), F(1.f));
      masking = masking_of(v, wo, mirrored, select<F>(t > 0.f, refract(wo, h, c, t, v.eta), none));
    }
    Mask<F> crosses(false);
    if constexpr (kGlass) crosses = not_(Mask<F>(choice < facet(v, c, masking).reflect_share()));
    Vec3<F> wi = mirrored;
    if (kGlass && any(crosses)) {
      const Vec3<F> straight(mirrored.x, mirrored.y, F(-mirrored.z));
      const Vec3<F> refracted = refract(wo, h, c, refracted_cos(c, v.eta), v.eta);
      wi = select<F>(crosses, select<F>(thin, straight, refracted), wi);
    }
    // A microfacet may reflect below the surface or refract above it; such samples are invalid.
    const Mask<F> right = (wi.z > 0.f) ^ crosses;
    const F len2 = length_squared(wi);
    const F inv = 1.f / sqrt(select(len2 > 1e-20f, len2, F(1.f)));
    return {select<F>(right & (len2 > 1e-20f), wi * inv, Vec3<F>(F(1.f), F(0.f), F(0.f))), crosses};
  }

 private:
  /// Returns the index of refraction whose F0 is `specular_weight` times the F0 of index `eta`.
  F scaled_ior(const F& eta) const {
    const F root = F(eta - 1.f) / F(eta + 1.f);
    const F e = copysign(sqrt(min(F(specular_weight * root * root), F(0.66f))), root);
    const F scaled = F(1.f + e) / F(1.f - e);
    return select(specular_weight == 1.f, eta, scaled);
  }
  static F wall_of(const F& r) { return F(2.f * r) / F(1.f + r); }

  /// Albedo of the interface over the diffuse base with a thin film. Smooth: the reflectance. For a
  /// rough interface, this is the albedo without film, plus the difference made by the film,
  /// integrated over the cosines of the visible microfacets.
  Color<F> filmed_gloss(const View& v, const F& z, const EnergyLookup<F>& lookup) const {
    const Color<F> mirror = film.over_dielectric(z, gloss_ior);
    const Mask<F> rough = (film.weight > 0.f) & (opaque > 0.f) & not_(smooth);
    if (none(rough)) return mirror;
    Color<F> more(F(0.f));
    for (uint32_t k = 0; k < EnergyTables::kRule; ++k) {
      const auto [c, weight] = lookup.rule(k);
      const Color<F> bare(fresnel_dielectric(c, gloss_ior).reflectance);
      more += Color<F>(film.over_dielectric(c, gloss_ior) - bare) * weight;
    }
    const Color<F> zero(F(0.f)), one(F(1.f));
    return select<F>(rough, min(max(Color<F>(v.gloss + more * v.gloss_scale), zero), one), mirror);
  }
};

}  // namespace wavecomb
