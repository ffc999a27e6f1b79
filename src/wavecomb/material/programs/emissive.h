// SPDX-License-Identifier: Apache-2.0
/// Program "emissive": emission only (fetch_emission), no reflection.
#pragma once

#include "wavecomb/material/bsdf.h"

namespace wavecomb {

/// BSDF that reflects nothing.
template <typename F>
class EmissiveBsdf : public BsdfTraits {
 public:
  static constexpr ProgramId kProgram = ProgramId::kEmissive;
  static constexpr bool kEmits = true;
  static constexpr bool kHasNonDelta = false;
  static constexpr bool kOnGaussianSplats = true;
  static constexpr uint32_t kInputs = 0;

  EmissiveBsdf(const ShadingParams<F>& /*params*/, bool /*schlick*/) {}

  Color<F> albedo() const { return Color<F>(F(0.f)); }
  Mask<F> has_non_delta() const { return Mask<F>(false); }
  F delta_probability(const Vec3<F>& /*wo*/) const { return F(0.f); }
  BsdfEval<F> eval(const Vec3<F>& /*wo*/, const Vec3<F>& /*wi*/) const {
    return {Color<F>(F(0.f)), F(0.f)};
  }
  Color<F> diffuse_f_cos(const Vec3<F>& /*wo*/, const Vec3<F>& /*wi*/) const {
    return Color<F>(F(0.f));
  }
  BsdfSample<F> sample(const Vec3<F>& /*wo*/, const F& /*u_lobe*/, const F& /*u*/,
                       const F& /*v*/) const {
    return empty_sample<F>();
  }
};

}  // namespace wavecomb
