// SPDX-License-Identifier: Apache-2.0
/// Program "plastic": a diffuse base under a clear, smooth or rough dielectric coat; two-sided.
#pragma once

#include "wavecomb/material/bsdf.h"
#include "wavecomb/material/lobes/coat.h"
#include "wavecomb/material/lobes/lambert.h"
#include "wavecomb/material/lobes/microfacet_reflection.h"
#include "wavecomb/material/lobes/rough_interface.h"

namespace wavecomb {

/// Plastic BSDF, f = coat + base_color / pi * coat_transmission. The albedos of the coat account
/// for its roughness and for multiple scattering, so a white base under a lossless coat keeps all
/// energy.
template <typename F>
class PlasticBsdf : public BsdfTraits {
 public:
  static constexpr ProgramId kProgram = ProgramId::kPlastic;
  static constexpr bool kReadsIor = true;
  static constexpr uint32_t kInputs =
      input_bit(Input::kBaseColor) | input_bit(Input::kRoughness) | input_bit(Input::kNormal);

  PlasticBsdf(const ShadingParams<F>& params, bool schlick)
      : base_(params.base_color),
        roughness_(params.roughness),
        coat_(coat_ior(params.ior), F(schlick ? 0.f : 1.f)) {
    const F alpha = alpha_from_roughness(roughness_);
    smooth_ = alpha < kDeltaAlpha;
    ggx_.alpha = max(alpha, F(kDeltaAlpha));
    lost_ = LostEnergy<F>(ggx_.alpha);
    interface_ = RoughInterface<F>(coat_, roughness_, ggx_.alpha, lost_, smooth_);
    average_ = interface_.average(coat_.f0_exact, F(0.f));
  }

  Color<F> albedo() const { return lerp(base_, Color<F>(F(1.f)), coat_.f0_exact); }
  Mask<F> has_non_delta() const { return not_(smooth_) | not_(is_black(base_)); }
  F delta_probability(const Vec3<F>& wo) const {
    const F p = coat_probability(coat_albedo(abs(wo.z)));
    return select(smooth_ & (wo.z != 0.f), p, F(0.f));
  }

  BsdfEval<F> eval(const Vec3<F>& wo, const Vec3<F>& wi) const {
    const F side = side_of(wo);
    const Vec3<F> o = mirror_z(wo, side);
    const F coat = coat_albedo(o.z);
    return eval_above(o, mirror_z(wi, side), coat, coat_probability(coat));
  }

  Color<F> diffuse_f_cos(const Vec3<F>& wo, const Vec3<F>& wi) const {
    const F side = side_of(wo);
    const Vec3<F> o = mirror_z(wo, side), i = mirror_z(wi, side);
    return base_ * below_coat(coat_albedo(o.z), i, select(o.z > 0.f, lambert_cos(i), F(0.f)));
  }

  BsdfSample<F> sample(const Vec3<F>& wo_, const F& u_lobe, const F& u, const F& v) const {
    const F side = side_of(wo_);
    const Vec3<F> wo = mirror_z(wo_, side);
    const F coat = coat_albedo(wo.z);
    const F p = coat_probability(coat);
    const Mask<F> chose_coat = u_lobe < p;
    const Mask<F> delta = chose_coat & smooth_ & (wo.z > 0.f);
    const Vec3<F> mirror(-wo.x, -wo.y, wo.z);
    const Vec3<F> glossy = select<F>(smooth_, mirror, sample_microfacet(ggx_, wo, u, v));
    const Vec3<F> wi = select<F>(chose_coat, glossy, square_to_cosine_hemisphere(u, v));
    const BsdfEval<F> e = eval_above(wo, wi, coat, p);
    const Mask<F> valid = not_(delta) & (e.pdf > 0.f);
    const F inv_pdf = 1.f / select(valid, e.pdf, F(1.f));
    BsdfSample<F> s = empty_sample<F>();
    s.wi = mirror_z(wi, side);
    s.weight = select<F>(valid, e.f_cos * inv_pdf, Color<F>(F(0.f)));
    s.weight = select<F>(delta, Color<F>(F(coat / max(p, F(1e-20f)))), s.weight);
    s.pdf = select(delta, p, select(valid, e.pdf, F(0.f)));
    s.is_delta = delta;
    s.roughness = select(chose_coat, select(smooth_, F(0.f), roughness_), F(1.f));
    return s;
  }

 private:
  F reflectance(const F& cos_i) const { return coat_(coat_.f0_exact, cos_i); }

  /// Directional albedo of the coat for cosine z, which is the Fresnel reflectance for a smooth
  /// coat.
  F coat_albedo(const F& z) const {
    const F lost = select(smooth_, F(0.f), lost_(z));
    return interface_.albedo(coat_.f0_exact, F(0.f), z, lost);
  }

  /// Probability of sampling the coat: its fraction of the estimated contribution of coat and base,
  /// clamped to [0.05, 0.95] unless the base is black.
  F coat_probability(const F& coat) const {
    const F diffuse = luminance(base_) * F(1.f - coat);
    const F share = coat / max(F(coat + diffuse), F(1e-20f));
    return select(is_black(base_), F(1.f), clamp(share, F(0.05f), F(0.95f)));
  }

  /// f |cos theta_i| of the base without its colour.
  F below_coat(const F& coat_o, const Vec3<F>& wi, const F& cosine) const {
    return coat_transmission(coat_o, coat_albedo(max(wi.z, F(0.f))), average_) * cosine;
  }

  BsdfEval<F> eval_above(const Vec3<F>& wo, const Vec3<F>& wi, const F& coat_o, const F& p) const {
    const MicrofacetEval<F> m = eval_microfacet(ggx_, wo, wi);
    const F glossy = select(smooth_, F(0.f), F(m.f_cos * reflectance(m.cos_h)));
    const F glossy_pdf = select(smooth_, F(0.f), m.pdf);
    const F cosine = select(wo.z > 0.f, lambert_cos(wi), F(0.f));
    const F through = below_coat(coat_o, wi, cosine);
    return {fma(base_, through, Color<F>(glossy)), fma(p, glossy_pdf, F(F(1.f - p) * cosine))};
  }

  Color<F> base_;
  F roughness_;
  CoatFresnel<F> coat_;
  LostEnergy<F> lost_;
  RoughInterface<F> interface_;
  F average_;
  Ggx<F> ggx_;
  Mask<F> smooth_;
};

}  // namespace wavecomb
