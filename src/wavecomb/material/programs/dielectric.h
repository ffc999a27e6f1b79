// SPDX-License-Identifier: Apache-2.0
/// Program "dielectric": glass and liquids, smooth or rough. The viewer is outside if wo.z > 0.
/// Inside, the relative index is 1 / ior, and total internal reflection is possible.
#pragma once

#include "wavecomb/material/lobes/rough_dielectric.h"

namespace wavecomb {

/// Dielectric BSDF; base_color tints transmission.
template <typename F>
class DielectricBsdf : public BsdfTraits {
 public:
  static constexpr ProgramId kProgram = ProgramId::kDielectric;
  static constexpr bool kReadsIor = true;
  static constexpr bool kTransmits = true;
  static constexpr bool kHasTerminator = false;
  static constexpr uint32_t kInputs =
      input_bit(Input::kBaseColor) | input_bit(Input::kRoughness) | input_bit(Input::kNormal);

  DielectricBsdf(const ShadingParams<F>& params, bool schlick)
      : tint_(params.base_color),
        ior_(params.ior),
        roughness_(params.roughness),
        schlick_(schlick) {
    const F alpha = alpha_from_roughness(roughness_);
    smooth_ = is_smooth_dielectric(alpha, ior_);
    ggx_.alpha = max(alpha, F(kDeltaAlpha));
  }

  Color<F> albedo() const { return tint_; }
  Mask<F> has_non_delta() const { return not_(smooth_); }
  F delta_probability(const Vec3<F>& wo) const {
    return select(smooth_ & (wo.z != 0.f), F(1.f), F(0.f));
  }

  BsdfEval<F> eval(const Vec3<F>& wo, const Vec3<F>& wi) const {
    if (all(smooth_)) return {Color<F>(F(0.f)), F(0.f)};
    const BsdfEval<F> e = eval_rough_dielectric(rough(), wo, wi);
    return {select<F>(smooth_, Color<F>(F(0.f)), e.f_cos), select(smooth_, F(0.f), e.pdf)};
  }

  /// The whole BSDF counts as specular.
  Color<F> diffuse_f_cos(const Vec3<F>& /*wo*/, const Vec3<F>& /*wi*/) const {
    return Color<F>(F(0.f));
  }

  BsdfSample<F> sample(const Vec3<F>& wo, const F& u_lobe, const F& u, const F& v) const {
    BsdfSample<F> s = empty_sample<F>();
    if (any(smooth_)) s = sample_smooth_dielectric(wo, ior_, tint_, schlick_, u_lobe);
    if (!all(smooth_)) {
      const BsdfSample<F> by_microfacet = sample_rough_dielectric(rough(), wo, u_lobe, u, v);
      s = select_sample(smooth_, s, by_microfacet);
    }
    return s;
  }

 private:
  RoughDielectric<F> rough() const { return {ggx_, ior_, tint_, roughness_, schlick_}; }

  Color<F> tint_;
  F ior_, roughness_;
  Ggx<F> ggx_;
  Mask<F> smooth_;
  bool schlick_;
};

}  // namespace wavecomb
