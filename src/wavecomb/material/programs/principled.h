// SPDX-License-Identifier: Apache-2.0
/// Program "principled": UsdPreviewSurface.
#pragma once

#include "wavecomb/material/bsdf.h"
#include "wavecomb/material/lobes/lambert.h"
#include "wavecomb/material/lobes/microfacet_reflection.h"
#include "wavecomb/material/lobes/principled_layers.h"
#include "wavecomb/material/program_list.h"

namespace wavecomb {

/// Two-sided BSDF of UsdPreviewSurface ("UsdPreviewSurface Specification", OpenUSD): clearcoat over
/// specular reflection over diffuse reflection and straight transmission. Ray traversal handles
/// straight transmission (lobes/straight_transmission.h), except for the part by which its colours
/// differ, which is a delta lobe of the BSDF. The specular lobe is GGX
/// with multiple scattering, which is sampled with the diffuse lobe. F90 is 1, and F0 is lerp(((1 -
/// ior) / (1 + ior))^2, base_color, metallic), or specular_color in the specular workflow. The
/// diffuse colour is base_color (1 - metallic) opacity, and straight transmission is 1 - opacity;
/// both are multiplied by the transmission of the specular interface, which follows from its rough
/// albedo (RoughInterface). The clearcoat is a GGX lobe of the same index, times `clearcoat`. It
/// dims the layers below by its albedo at the more grazing of the two directions, which is
/// reciprocal and adds no energy. docs/decisions/preview-surface.md compares this program with the
/// specification and with other renderers.
///
/// A program variant (material/description/variants.h) supports only some features. For materials
/// without other features, its results are bitwise equal to those of the complete program.
template <typename F, uint32_t kParts>
class PrincipledBsdf : public ViewedBsdf<PrincipledBsdf<F, kParts>, F>,
                       private PrincipledLayers<F, kParts> {
  using Viewed = ViewedBsdf<PrincipledBsdf<F, kParts>, F>;
  using Layers = PrincipledLayers<F, kParts>;
  using Layers::kCoat;
  using Layers::kMetal;
  using typename Layers::Tint;
  /// Whether the BSDF may transmit light: layers pass colours differently, or the surface emits.
  static constexpr bool kTinted = Layers::kStraight && kMetal;

 public:
  static constexpr ProgramId kProgram = ProgramId::kPrincipled;
  static constexpr bool kReadsIor = true;
  static constexpr bool kEmits = (kParts & kEmissionPart) != 0;
  static constexpr bool kTextured = (kParts & kTexturePart) != 0;
  static constexpr bool kTransmitsStraight = Layers::kStraight;
  /// Inputs that may read textures. The mask has either all inputs or none, because even one
  /// textured input aligns the tangent frame with the texture.
  static constexpr uint32_t kInputs = !kTextured ? 0u : kPrincipledInputs;

  PrincipledBsdf(const ShadingParams<F>& params, bool schlick) : Layers(params, schlick) {}

  Color<F> albedo() const { return min(Color<F>(diffuse_ + Color<F>(f0_)), Color<F>(F(1.f))); }
  Mask<F> has_non_delta() const {
    Mask<F> any_lobe = not_(is_black(diffuse_)) | not_(smooth_);
    if constexpr (kCoat) any_lobe = any_lobe | (not_(coat_smooth_) & (clearcoat_ > 0.f));
    return any_lobe;
  }

  /// Values that depend on wo only: directional albedos, which are Fresnel reflectances for smooth
  /// lobes, and sampling probabilities. `o` is wo mirrored to the upper side.
  struct View {
    F side;
    Vec3<F> o;
    F coat, lost;
    /// Factor of the multiple-scattering lobe: the energy L(wo) that single scattering loses,
    /// divided by the mean loss L_avg.
    F lost_share;
    Tint specular;     ///< directional albedo
    Color<F> diffuse;  ///< diffuse colour times transmission towards the viewer
    Color<F> tinted;   ///< transmission of the BSDF
    MaskedView<F> masked;
    F p_diffuse, p_specular, p_coat, p_tinted;
  };

  View view(const Vec3<F>& wo) const {
    View v;
    v.side = side_of(wo);
    v.o = mirror_z(wo, v.side);
    v.coat = F(0.f);
    const F z = max(v.o.z, F(0.f));
    if (has_coat()) v.coat = coat_albedo(z);
    v.lost = lost_(z);
    v.lost_share = v.lost / lost_.average;
    v.specular = specular_albedo(z);
    v.diffuse = diffuse_ * coat_view_factor(v.specular, average_);
    v.masked = MaskedView<F>(ggx_, v.o);
    const F below = 1.f - v.coat;
    const Color<F> passed = Color<F>(F(1.f)) - Color<F>(v.specular);
    v.tinted = Color<F>(F(0.f));
    if constexpr (kTinted)
      v.tinted = tinted_transmission(Color<F>(passed * F(below * transparency_)));
    // Probabilities are estimated contributions; a lobe that can contribute gets at least 0.02
    // before normalisation.
    const F floor(0.02f);
    const F multiple = F(below * v.lost) * luminance(Color<F>(multiple_));
    const F diffuse = select(is_black(diffuse_), multiple,
                             max(fma(below, luminance(diffuse_ * passed), multiple), floor));
    const F specular = max(F(below * luminance(Color<F>(v.specular))), floor);
    F coat(0.f), tinted(0.f);
    if constexpr (kCoat) coat = select(clearcoat_ > 0.f, max(v.coat, floor), F(0.f));
    if constexpr (kTinted)
      tinted = select(is_black(v.tinted), F(0.f), max(luminance(v.tinted), floor));
    const F inv = 1.f / F(F(diffuse + specular) + F(coat + tinted));
    v.p_diffuse = diffuse * inv;
    v.p_specular = specular * inv;
    v.p_coat = coat * inv;
    v.p_tinted = tinted * inv;
    return v;
  }

  using Viewed::delta_probability, Viewed::eval, Viewed::diffuse_f_cos, Viewed::sample;

  F delta_probability(const View& v) const {
    F mirrors = select(smooth_, v.p_specular, F(0.f));
    if constexpr (kCoat) mirrors = mirrors + select(coat_smooth_, v.p_coat, F(0.f));
    return select(v.o.z != 0.f, F(mirrors + v.p_tinted), F(0.f));
  }

  BsdfEval<F> eval(const View& v, const Vec3<F>& wi) const {
    return eval_above(v.o, mirror_z(wi, v.side), v);
  }

  Color<F> diffuse_f_cos(const View& v, const Vec3<F>& wi) const {
    const Vec3<F>& o = v.o;
    const Vec3<F> i = mirror_z(wi, v.side);
    const F cosine = select(o.z > 0.f, lambert_cos(i), F(0.f));
    F passed(1.f);
    if (has_coat()) passed = select(clearcoat_ > 0.f, below_coat(o, i), F(1.f));
    return v.diffuse * passing(max(i.z, F(0.f))) * F(cosine * passed);
  }

  BsdfSample<F> sample(const View& view, const F& u_lobe, const F& u, const F& v) const {
    const F& side = view.side;
    const Vec3<F>& wo = view.o;
    const F before_specular = view.p_diffuse;
    const F before_coat = before_specular + view.p_specular;
    const F before_tinted = before_coat + view.p_coat;
    const Mask<F> specular = (u_lobe >= before_specular) & (u_lobe < before_coat);
    Mask<F> coat(false), tinted(false), rough_coat(false), smooth_coat(false);
    if constexpr (kCoat) {
      coat = (u_lobe >= before_coat) & (u_lobe < before_tinted);
      smooth_coat = coat & coat_smooth_;
      rough_coat = coat & not_(coat_smooth_);
    }
    if constexpr (kTinted) tinted = (u_lobe >= before_tinted) & (view.p_tinted > 0.f);
    const Mask<F> above = wo.z > 0.f;
    const Mask<F> mirrors = ((specular & smooth_) | smooth_coat) & above;
    const Mask<F> passes = tinted & above;

    Vec3<F> wi = square_to_cosine_hemisphere(u, v);
    const Mask<F> glossy = (specular & not_(smooth_)) | rough_coat;
    if (any(glossy)) {
      Ggx<F> ggx{ggx_.alpha};
      if constexpr (kCoat) ggx.alpha = select(coat, coat_ggx_.alpha, ggx_.alpha);
      wi = select<F>(glossy, sample_microfacet(ggx, wo, u, v), wi);
    }
    wi = select<F>(mirrors, Vec3<F>(-wo.x, -wo.y, wo.z), wi);
    if constexpr (kTinted) wi = select<F>(passes, -wo, wi);

    const BsdfEval<F> e = eval_above(wo, wi, view);
    const Mask<F> delta = mirrors | passes;
    const Mask<F> valid = not_(delta) & (e.pdf > 0.f);
    const Color<F> zero(F(0.f));
    BsdfSample<F> s = empty_sample<F>();
    s.wi = mirror_z(wi, side);
    s.weight = select<F>(valid, e.f_cos * F(1.f / select(valid, e.pdf, F(1.f))), zero);
    s.pdf = select(valid, e.pdf, F(0.f));
    F p_delta = view.p_specular;
    Color<F> f_delta(view.specular);
    if constexpr (kCoat) {
      p_delta = select(coat, view.p_coat, p_delta);
      f_delta = select<F>(coat, Color<F>(view.coat), f_delta * F(1.f - view.coat));
    }
    if constexpr (kTinted) {
      p_delta = select(passes, view.p_tinted, p_delta);
      f_delta = select<F>(passes, view.tinted, f_delta);
    }
    s.weight = select<F>(delta, f_delta * F(1.f / max(p_delta, F(1e-20f))), s.weight);
    s.pdf = select(delta, p_delta, s.pdf);
    s.is_delta = delta;
    F lobe_roughness = select(specular, roughness_, F(1.f));
    if constexpr (kCoat) lobe_roughness = select(coat, coat_roughness_, lobe_roughness);
    s.roughness = select(delta, F(0.f), lobe_roughness);
    return s;
  }

 private:
  /// Transmission of the clearcoat for light from the layers below.
  F below_coat(const Vec3<F>& wo, const Vec3<F>& wi) const {
    return F(1.f - coat_albedo(max(min(wo.z, abs(wi.z)), F(0.f))));
  }

  F coat_reflectance(const F& cos_i) const { return clearcoat_ * coat_(coat_.f0_exact, cos_i); }
  /// Transmission of the specular interface for cosine z.
  Tint passing(const F& z) const { return Tint(F(1.f)) - specular_albedo(z); }

  BsdfEval<F> eval_above(const Vec3<F>& wo, const Vec3<F>& wi, const View& view) const {
    const F cosine = select(wo.z > 0.f, lambert_cos(wi), F(0.f));
    const F zi = max(wi.z, F(0.f));
    const F again = view.lost_share * lost_(zi);
    Color<F> f = fma(Color<F>(multiple_), again, view.diffuse * passing(zi)) * cosine;
    F pdf = view.p_diffuse * cosine;
    if (!all(smooth_)) {
      const MicrofacetEval<F> m = eval_microfacet(ggx_, view.masked, wo, wi);
      f += Color<F>(interface_(f0_, m.cos_h) * select(smooth_, F(0.f), m.f_cos));
      pdf = fma(view.p_specular, select(smooth_, F(0.f), m.pdf), pdf);
    }
    if (has_coat()) {
      const Mask<F> coated = clearcoat_ > 0.f;
      f = select<F>(coated, f * below_coat(wo, wi), f);
      const Mask<F> rough = coated & not_(coat_smooth_);
      if (any(rough)) {
        const MicrofacetEval<F> m = eval_microfacet(coat_ggx_, wo, wi);
        const F glossy = m.f_cos * coat_reflectance(m.cos_h);
        f = select<F>(rough, f + Color<F>(glossy), f);
        pdf = select(rough, fma(view.p_coat, m.pdf, pdf), pdf);
      }
    }
    return {f, pdf};
  }

  /// Returns the part of straight transmission that ray traversal leaves to the BSDF. A remainder
  /// of rounding errors is ignored.
  Color<F> tinted_transmission(const Color<F>& straight) const {
    const Color<F> rest = straight - Color<F>(passing_probability(straight));
    const Mask<F> real = max_component(rest) > F(1e-5f * max_component(straight));
    return select<F>(real, rest, Color<F>(F(0.f)));
  }

  using Layers::average_;
  using Layers::clearcoat_;
  using Layers::coat_;
  using Layers::coat_albedo;
  using Layers::coat_ggx_;
  using Layers::coat_roughness_;
  using Layers::coat_smooth_;
  using Layers::diffuse_;
  using Layers::f0_;
  using Layers::ggx_;
  using Layers::has_coat;
  using Layers::interface_;
  using Layers::lost_;
  using Layers::multiple_;
  using Layers::passing_probability;
  using Layers::roughness_;
  using Layers::smooth_;
  using Layers::specular_albedo;
  using Layers::transparency_;
};

}  // namespace wavecomb
