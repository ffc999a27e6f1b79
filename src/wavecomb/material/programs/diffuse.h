// SPDX-License-Identifier: Apache-2.0
/// Program "diffuse": a two-sided Lambertian surface.
#pragma once

#include "wavecomb/material/bsdf.h"
#include "wavecomb/material/lobes/lambert.h"

namespace wavecomb {

/// Lambertian BSDF, f = base_color / pi.
template <typename F>
class DiffuseBsdf : public BsdfTraits {
 public:
  static constexpr ProgramId kProgram = ProgramId::kDiffuse;
  static constexpr uint32_t kInputs = input_bit(Input::kBaseColor) | input_bit(Input::kNormal);

  DiffuseBsdf(const ShadingParams<F>& params, bool /*schlick*/) : base_(params.base_color) {}

  Color<F> albedo() const { return base_; }
  Mask<F> has_non_delta() const { return not_(is_black(base_)); }
  F delta_probability(const Vec3<F>& /*wo*/) const { return F(0.f); }

  BsdfEval<F> eval(const Vec3<F>& wo, const Vec3<F>& wi) const {
    const F side = side_of(wo);
    const F pdf = select(wo.z != 0.f, lambert_cos(mirror_z(wi, side)), F(0.f));
    return {base_ * pdf, pdf};
  }

  Color<F> diffuse_f_cos(const Vec3<F>& wo, const Vec3<F>& wi) const { return eval(wo, wi).f_cos; }

  BsdfSample<F> sample(const Vec3<F>& wo, const F& /*u_lobe*/, const F& u, const F& v) const {
    const Vec3<F> wi = square_to_cosine_hemisphere(u, v);
    const F pdf = select(wo.z != 0.f, lambert_cos(wi), F(0.f));
    BsdfSample<F> s = empty_sample<F>();
    s.wi = mirror_z(wi, side_of(wo));
    s.weight = select<F>(pdf > 0.f, base_, Color<F>(F(0.f)));
    s.pdf = pdf;
    s.roughness = F(1.f);
    return s;
  }

 private:
  Color<F> base_;
};

}  // namespace wavecomb
