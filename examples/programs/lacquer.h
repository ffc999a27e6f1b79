// SPDX-License-Identifier: Apache-2.0
/// Program "lacquer": a smooth clear coat of weight `clearcoat` over a diffuse base, alike from
/// both sides.
#pragma once

#include "wavecomb/core/math.h"
#include "wavecomb/material/bsdf.h"
#include "wavecomb/material/lobes/fresnel.h"
#include "wavecomb/material/lobes/lambert.h"
#include "wavecomb/material/openpbr_params.h"

namespace wavecomb {

/// f = coat + base_color / pi (1 - r(cos_o)) (1 - r(cos_i)), where r is the reflectance of the
/// coat. Light that the coat reflects back to the base is lost, so that the program gains nothing.
template <typename F>
class LacquerBsdf : public BsdfTraits {
 public:
  static constexpr ProgramId kProgram = ProgramId::kLacquer;
  static constexpr uint32_t kInputs =
      input_bit(Input::kBaseColor) | input_bit(Input::kClearcoat) | input_bit(Input::kNormal);
  using Params = OpenPbrParams<F>;

  LacquerBsdf(const Params& params, bool /*schlick*/)
      : base_(params.base_color), weight_(params.clearcoat), ior_(params.coat_ior) {}

  Color<F> albedo() const { return base_; }
  Mask<F> has_non_delta() const { return not_(is_black(base_)); }
  F delta_probability(const Vec3<F>& wo) const {
    const F r = reflectance(abs(wo.z));
    return select(wo.z != 0.f, select(is_black(base_), F(1.f), r), F(0.f));
  }

  BsdfEval<F> eval(const Vec3<F>& wo, const Vec3<F>& wi) const {
    const F cosine = lambert_cos(mirror_z(wi, side_of(wo)));
    const F below = F(1.f - delta_probability(wo)) * select(wo.z != 0.f, cosine, F(0.f));
    return {base_ * F(below * F(1.f - reflectance(abs(wi.z)))), below};
  }

  Color<F> diffuse_f_cos(const Vec3<F>& wo, const Vec3<F>& wi) const { return eval(wo, wi).f_cos; }

  BsdfSample<F> sample(const Vec3<F>& wo, const F& u_lobe, const F& u, const F& v) const {
    const F p = delta_probability(wo);
    const Mask<F> coat = u_lobe < p;
    const Vec3<F> below = mirror_z(square_to_cosine_hemisphere(u, v), side_of(wo));
    const BsdfEval<F> e = eval(wo, below);
    const Mask<F> valid = not_(coat) & (e.pdf > 0.f);
    const F inv_pdf = 1.f / select(valid, e.pdf, F(1.f));
    BsdfSample<F> s = empty_sample<F>();
    s.wi = select<F>(coat, Vec3<F>(-wo.x, -wo.y, wo.z), below);
    s.weight = select<F>(valid, e.f_cos * inv_pdf, Color<F>(F(0.f)));
    s.weight = select<F>(coat, Color<F>(reflectance(abs(wo.z)) / max(p, F(1e-20f))), s.weight);
    s.pdf = select(coat, p, select(valid, e.pdf, F(0.f)));
    s.is_delta = coat;
    s.roughness = select(coat, F(0.f), F(1.f));
    return s;
  }

 private:
  F reflectance(const F& cosine) const {
    return weight_ * fresnel_dielectric(cosine, ior_).reflectance;
  }

  Color<F> base_;
  F weight_, ior_;
};

}  // namespace wavecomb
