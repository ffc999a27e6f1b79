// SPDX-License-Identifier: Apache-2.0
/// Program "metal": a GGX conductor, alike from both sides.
#pragma once

#include "wavecomb/material/bsdf.h"
#include "wavecomb/material/lobes/fresnel.h"
#include "wavecomb/material/lobes/lambert.h"
#include "wavecomb/material/lobes/microfacet_reflection.h"

namespace wavecomb {

/// Reflectance: base_color at normal incidence with a tint at 82 degrees, or the exact conductor of
/// the measured index where kConductorIndex is set. A black tint (the unset value) counts as white,
/// which is Schlick's formula.
template <typename F>
class MetalBsdf {
 public:
  static constexpr ProgramId kProgram = ProgramId::kMetal;
  static constexpr uint32_t kSlots = slot_bit(Slot::kBaseColor) | slot_bit(Slot::kSpecularColor) |
                                     slot_bit(Slot::kRoughness) | slot_bit(Slot::kNormal);
  static constexpr bool kHasNonDelta = true;

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
  }

  Color<F> albedo() const { return tinted_.f0; }
  Mask<F> has_non_delta() const { return not_(smooth_); }

  BsdfEval<F> eval(const Vec3<F>& wo_, const Vec3<F>& wi_) const {
    const F side = side_of(wo_);
    const Vec3<F> wo = mirror_z(wo_, side), wi = mirror_z(wi_, side);
    const MicrofacetEval<F> m = eval_microfacet(ggx_, wo, wi);
    const F f_cos = select(smooth_, F(0.f), m.f_cos);
    return {fresnel(m.cos_h) * f_cos, select(smooth_, F(0.f), m.pdf)};
  }

  BsdfSample<F> sample(const Vec3<F>& wo_, const F& /*u_lobe*/, const F& u, const F& v) const {
    const F side = side_of(wo_);
    const Vec3<F> wo = mirror_z(wo_, side);
    const Vec3<F> mirror(-wo.x, -wo.y, wo.z);
    const Vec3<F> wi = select<F>(smooth_, mirror, sample_microfacet(ggx_, wo, u, v));
    const MicrofacetEval<F> m = eval_microfacet(ggx_, wo, wi);
    const Mask<F> rough = not_(smooth_) & (m.pdf > 0.f);
    const Mask<F> delta = smooth_ & (wo.z > 0.f);
    const F ratio = select(rough, F(m.f_cos / select(rough, m.pdf, F(1.f))), F(1.f));
    BsdfSample<F> s = empty_sample<F>();
    s.wi = mirror_z(wi, side);
    s.weight =
        select<F>(rough | delta, fresnel(select(smooth_, wo.z, m.cos_h)) * ratio, Color<F>(F(0.f)));
    s.pdf = select(delta, F(1.f), select(rough, m.pdf, F(0.f)));
    s.is_delta = delta;
    s.roughness = select(smooth_, F(0.f), roughness_);
    return s;
  }

 private:
  Color<F> fresnel(const F& cos_h) const {
    Color<F> f = tinted_(cos_h);
    if (any(exact_)) f = select<F>(exact_, fresnel_conductor(cos_h, eta_, k_), f);
    return f;
  }

  Color<F> eta_, k_;
  F roughness_;
  F82Tint<F> tinted_;
  Ggx<F> ggx_;
  Mask<F> measured_, exact_, smooth_;
};

}  // namespace wavecomb
