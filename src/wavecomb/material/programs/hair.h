// SPDX-License-Identifier: Apache-2.0
/// Program "hair": hair and fur fibres (material/lobes/fibre.h), equivalent to MaterialX's
/// `chiang_hair_bsdf` (docs/hair.md).
#pragma once

#include <algorithm>

#include "wavecomb/material/bsdf.h"
#include "wavecomb/material/lobes/fibre.h"

namespace wavecomb {

/// Hair BSDF. base_color is the colour of many fibres together (Chiang et al. 2016, 4.2), roughness
/// the longitudinal roughness. Program-specific parameters, in the order of their row
/// (material/description/programs.h): azimuthal_roughness; scale_tt and scale_trt, factors of the
/// longitudinal width of TT and TRT; cuticle_tilt in degrees towards the root; tint_r, tint_tt,
/// tint_trt.
///
/// The BSDF describes the whole fibre, transmission included; continued rays hit only the outside
/// of fibres (accel/presence.h). Fibres have no inner side, and |cos theta_i| is included in the
/// model. The BSDF is not reciprocal, because wo determines the offset h of the hit.
template <typename F>
class HairBsdf : public ViewedBsdf<HairBsdf<F>, F> {
  using Viewed = ViewedBsdf<HairBsdf<F>, F>;

 public:
  static constexpr ProgramId kProgram = ProgramId::kHair;
  static constexpr bool kReadsIor = true;
  static constexpr bool kTransmits = true;
  static constexpr bool kOnFibre = true;
  static constexpr bool kHasTerminator = false;
  static constexpr uint32_t kInputs = input_bit(Input::kBaseColor) | input_bit(Input::kRoughness);
  using View = typename Fibre<F>::View;

  HairBsdf(const SpecificShadingParams<F>& p, bool /*schlick*/) : base_(p.base_color) {
    enum Own : uint8_t { kAzimuthal, kScaleTt, kScaleTrt, kTilt, kTintR, kTintTt, kTintTrt };
    const F about = max(p.own[kAzimuthal], F(kMinRoughness));
    const F v = fibre_variance(max(p.roughness, F(kMinRoughness)));
    fibre_.ior = max(p.ior, F(1.f));
    fibre_.variance = {v, v * sqr(p.own[kScaleTt]), v * sqr(p.own[kScaleTrt])};
    fibre_.scale = fibre_scale(about);
    fibre_.tilt = p.own[kTilt] * (1.f / 360.f);
    fibre_.tint = {p.own[kTintR], p.own[kTintTt], p.own[kTintTrt]};
    const F divisor = 1.f / fibre_color_divisor(about);
    const auto absorption = [&](const F& c) {
      return sqr(F(log(clamp(c, F(kDarkest), F(1.f))) * divisor));
    };
    fibre_.absorption = {absorption(base_.x), absorption(base_.y), absorption(base_.z)};
  }

  Color<F> albedo() const { return base_; }
  Mask<F> has_non_delta() const { return Mask<F>(true); }
  View view(const Vec3<F>& wo) const { return fibre_.view(wo); }
  F delta_probability(const View& /*view*/) const { return F(0.f); }

  BsdfEval<F> eval(const View& view, const Vec3<F>& wi) const {
    BsdfEval<F> e;
    fibre_.eval(view, wi, e.f_cos, e.pdf);
    return e;
  }

  /// The whole BSDF counts as specular.
  Color<F> diffuse_f_cos(const View& /*view*/, const Vec3<F>& /*wi*/) const {
    return Color<F>(F(0.f));
  }

  BsdfSample<F> sample(const View& view, const F& u_lobe, const F& u, const F& v) const {
    BsdfSample<F> s = empty_sample<F>();
    const Vec3<F> wi = normalize(fibre_.sample(view, u_lobe, u, v));
    const BsdfEval<F> e = eval(view, wi);
    const Mask<F> valid = (e.pdf > 1e-20f) & is_finite(e.pdf);
    s.wi = select<F>(valid, wi, s.wi);
    s.pdf = select(valid, e.pdf, F(0.f));
    s.weight = select<F>(valid, e.f_cos * F(1.f / select(valid, e.pdf, F(1.f))), Color<F>(F(0.f)));
    return s;
  }

  using Viewed::delta_probability, Viewed::eval, Viewed::diffuse_f_cos, Viewed::sample;

 private:
  /// Minimum roughness; lobes below it are too narrow for float precision.
  static constexpr float kMinRoughness = 0.02f;
  static constexpr float kDarkest = 1e-12f;
  Color<F> base_;
  Fibre<F> fibre_;
};

}  // namespace wavecomb
