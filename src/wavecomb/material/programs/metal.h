// SPDX-License-Identifier: Apache-2.0
/// Program "metal": a two-sided GGX conductor with multiple scattering.
#pragma once

#include "wavecomb/material/bsdf.h"
#include "wavecomb/material/lobes/fresnel.h"
#include "wavecomb/material/lobes/lambert.h"
#include "wavecomb/material/lobes/microfacet_reflection.h"
#include "wavecomb/material/lobes/multiple_scattering.h"

namespace wavecomb {

/// Metal BSDF. The reflectance of a metal is base_color at normal incidence with a tint at 82
/// degrees or, with kConductorIndex set, the Fresnel reflectance of the measured complex index. A
/// black tint, the default, stands for a white tint, which gives Schlick's formula.
template <typename F>
class MetalBsdf : public BsdfTraits {
 public:
  static constexpr ProgramId kProgram = ProgramId::kMetal;
  static constexpr uint32_t kInputs = input_bit(Input::kBaseColor) |
                                      input_bit(Input::kSpecularColor) |
                                      input_bit(Input::kRoughness) | input_bit(Input::kNormal);

  MetalBsdf(const ShadingParams<F>& params, bool schlick)
      : eta_(params.conductor_eta), k_(params.conductor_k), roughness_(params.roughness) {
    measured_ = Mask<F>((params.flags & UInt<F>(uint32_t{kConductorIndex})) != UInt<F>(0u));
    const Color<F> white(F(1.f));
    Color<F> f0 = params.base_color;
    Color<F> tint = select<F>(is_black(params.specular_color), white, params.specular_color);
    if (any(measured_)) {
      f0 = select<F>(measured_, fresnel_conductor(F(1.f), eta_, k_), f0);
      tint = select<F>(measured_, white, tint);
    }
    tinted_ = F82Tint<F>(f0, tint);
    exact_ = schlick ? Mask<F>(false) : measured_;
    const F alpha = alpha_from_roughness(roughness_);
    smooth_ = alpha < kDeltaAlpha;
    ggx_.alpha = max(alpha, F(kDeltaAlpha));
    lost_ = LostEnergy<F>(ggx_.alpha);
    multiple_ = lost_.tint(mean_reflectance(f0));
  }

  Color<F> albedo() const { return tinted_.f0; }
  Mask<F> has_non_delta() const { return not_(smooth_); }
  F delta_probability(const Vec3<F>& wo) const {
    return select(smooth_ & (wo.z != 0.f), F(1.f), F(0.f));
  }

  BsdfEval<F> eval(const Vec3<F>& wo, const Vec3<F>& wi) const {
    const F side = side_of(wo);
    const Vec3<F> o = mirror_z(wo, side);
    const F lost = lost_(o.z);
    return eval_above(o, mirror_z(wi, side), lost, multiple_probability(lost));
  }

  /// The whole BSDF counts as specular.
  Color<F> diffuse_f_cos(const Vec3<F>& /*wo*/, const Vec3<F>& /*wi*/) const {
    return Color<F>(F(0.f));
  }

  BsdfSample<F> sample(const Vec3<F>& wo_, const F& u_lobe, const F& u, const F& v) const {
    const F side = side_of(wo_);
    const Vec3<F> wo = mirror_z(wo_, side);
    const F lost = lost_(wo.z);
    const F p_multiple = multiple_probability(lost);
    const Mask<F> multiple = u_lobe < p_multiple;
    Vec3<F> wi = sample_microfacet(ggx_, wo, u, v);
    if (any(multiple)) wi = select<F>(multiple, square_to_cosine_hemisphere(u, v), wi);
    wi = select<F>(smooth_, Vec3<F>(-wo.x, -wo.y, wo.z), wi);
    const BsdfEval<F> e = eval_above(wo, wi, lost, p_multiple);
    const Mask<F> rough = not_(smooth_) & (e.pdf > 0.f);
    const Mask<F> delta = smooth_ & (wo.z > 0.f);
    const Color<F> ratio = e.f_cos * F(1.f / select(rough, e.pdf, F(1.f)));
    BsdfSample<F> s = empty_sample<F>();
    s.wi = mirror_z(wi, side);
    s.weight = select<F>(rough, ratio, Color<F>(F(0.f)));
    if (any(delta)) s.weight = select<F>(delta, fresnel(wo.z), s.weight);
    s.pdf = select(delta, F(1.f), select(rough, e.pdf, F(0.f)));
    s.is_delta = delta;
    s.roughness = select(smooth_, F(0.f), select(multiple, F(1.f), roughness_));
    return s;
  }

 private:
  Color<F> fresnel(const F& cos_h) const {
    Color<F> f = tinted_(cos_h);
    if (any(exact_)) f = select<F>(exact_, fresnel_conductor(cos_h, eta_, k_), f);
    return f;
  }

  /// Hemispherical mean of the reflectance. For a measured index, this is the mean of the tinted
  /// Schlick curve through the values at 0 and 82 degrees, accurate to about one per cent.
  Color<F> mean_reflectance(const Color<F>& f0) const {
    if (none(exact_)) return tinted_.average();
    const F c82(1.f / 7.f);
    const Color<F> exact = fresnel_conductor(c82, eta_, k_);
    const Color<F> schlick = fresnel_schlick(f0, c82);
    const auto ratio = [](const F& a, const F& b) { return min(F(a / max(b, F(1e-6f))), F(1.f)); };
    const Color<F> tint(ratio(exact.x, schlick.x), ratio(exact.y, schlick.y),
                        ratio(exact.z, schlick.z));
    return select<F>(exact_, F82Tint<F>(f0, tint).average(), tinted_.average());
  }

  /// Probability of sampling the multiple-scattering lobe; exactly 0 if the lobe is black.
  F multiple_probability(const F& lost) const {
    return select(smooth_, F(0.f), F(lost * luminance(multiple_)));
  }

  BsdfEval<F> eval_above(const Vec3<F>& wo, const Vec3<F>& wi, const F& lost, const F& p) const {
    const MicrofacetEval<F> m = eval_microfacet(ggx_, wo, wi);
    const F cosine = select(wo.z > 0.f, lambert_cos(wi), F(0.f));
    const F again = F(F(lost * lost_(max(wi.z, F(0.f)))) / lost_.average) * cosine;
    const Color<F> f = fma(multiple_, again, fresnel(m.cos_h) * m.f_cos);
    const F pdf = fma(p, cosine, F(F(1.f - p) * m.pdf));
    return {select<F>(smooth_, Color<F>(F(0.f)), f), select(smooth_, F(0.f), pdf)};
  }

  Color<F> eta_, k_, multiple_;
  F roughness_;
  F82Tint<F> tinted_;
  LostEnergy<F> lost_;
  Ggx<F> ggx_;
  Mask<F> measured_, exact_, smooth_;
};

}  // namespace wavecomb
