// SPDX-License-Identifier: Apache-2.0
/// Program "leaf": diffuse reflection and diffuse transmission, alike from both sides. `opacity` is
/// the fraction of the scattered light that is reflected.
#pragma once

#include "wavecomb/core/math.h"
#include "wavecomb/material/bsdf.h"
#include "wavecomb/material/lobes/lambert.h"

namespace wavecomb {

/// f = base_color / pi times opacity for reflection, and times 1 - opacity for transmission.
template <typename F>
class LeafBsdf : public BsdfTraits {
 public:
  static constexpr ProgramId kProgram = ProgramId::kLeaf;
  static constexpr bool kTransmits = true;
  static constexpr uint32_t kInputs =
      input_bit(Input::kBaseColor) | input_bit(Input::kOpacity) | input_bit(Input::kNormal);

  LeafBsdf(const ShadingParams<F>& params, bool /*schlick*/)
      : base_(params.base_color), reflected_(params.opacity) {}

  Color<F> albedo() const { return base_; }
  Mask<F> has_non_delta() const { return not_(is_black(base_)); }
  F delta_probability(const Vec3<F>& /*wo*/) const { return F(0.f); }

  BsdfEval<F> eval(const Vec3<F>& wo, const Vec3<F>& wi) const {
    const F share = select(wo.z * wi.z > 0.f, reflected_, F(1.f - reflected_));
    const F pdf = select(wo.z != 0.f, F(share * cosine_hemisphere_pdf(abs(wi.z))), F(0.f));
    return {base_ * pdf, pdf};
  }

  Color<F> diffuse_f_cos(const Vec3<F>& wo, const Vec3<F>& wi) const { return eval(wo, wi).f_cos; }

  BsdfSample<F> sample(const Vec3<F>& wo, const F& u_lobe, const F& u, const F& v) const {
    const F side = side_of(wo);
    const Vec3<F> above = square_to_cosine_hemisphere(u, v);
    BsdfSample<F> s = empty_sample<F>();
    s.wi = mirror_z(above, select(u_lobe < reflected_, side, F(-side)));
    s.pdf = eval(wo, s.wi).pdf;
    s.weight = select<F>(s.pdf > 0.f, base_, Color<F>(F(0.f)));
    s.roughness = F(1.f);
    return s;
  }

 private:
  Color<F> base_;
  F reflected_;
};

}  // namespace wavecomb
