// SPDX-License-Identifier: Apache-2.0
/// Layers of UsdPreviewSurface and the light that they let pass.
#pragma once

#include <memory>
#include <type_traits>

#include "wavecomb/material/bsdf.h"
#include "wavecomb/material/description/variants.h"
#include "wavecomb/material/lobes/coat.h"
#include "wavecomb/material/lobes/ggx.h"
#include "wavecomb/material/lobes/multiple_scattering.h"
#include "wavecomb/material/lobes/rough_interface.h"
#include "wavecomb/material/params.h"

namespace wavecomb {

/// Inputs of UsdPreviewSurface that may read textures, except emission.
inline constexpr uint32_t kPrincipledInputs =
    input_bit(Input::kBaseColor) | input_bit(Input::kSpecularColor) | input_bit(Input::kRoughness) |
    input_bit(Input::kMetallic) | input_bit(Input::kClearcoat) |
    input_bit(Input::kClearcoatRoughness) | input_bit(Input::kOpacity) | input_bit(Input::kNormal);

/// Parameters of the layers of UsdPreviewSurface at a hit: clearcoat over a specular interface over
/// a base. Shading (programs/principled.h) and ray traversal (lobes/straight_transmission.h) use
/// the same layers. `kParts` are the features of the program variant (Part).
template <typename F, uint32_t kParts>
class PrincipledLayers {
 protected:
  static constexpr bool kMetal = (kParts & kMetalPart) != 0, kCoat = (kParts & kCoatPart) != 0,
                        kStraight = (kParts & kTransmissionPart) != 0;
  /// Type of the specular reflectance: a colour, or a scalar in variants without metal, whose
  /// reflections are not coloured.
  using Tint = std::conditional_t<kMetal, Color<F>, F>;

 public:
  PrincipledLayers(const ShadingParams<F>& params, bool schlick) : roughness_(params.roughness) {
    const F ior = coat_ior(params.ior);
    f0_ = Tint(f0_from_ior(ior));
    diffuse_ = params.base_color;
    F exact(schlick ? 0.f : 1.f);
    F metallic(0.f);
    if constexpr (kMetal) {
      const Mask<F> specular_workflow =
          Mask<F>((params.flags & UInt<F>(uint32_t{kSpecularWorkflow})) != UInt<F>(0u));
      metallic = select(specular_workflow, F(0.f), params.metallic);
      f0_ = lerp(f0_, params.base_color, metallic);
      f0_ = select<F>(specular_workflow, params.specular_color, f0_);
      // Metals and the specular workflow use Schlick's formula, dielectrics the exact Fresnel
      // formula.
      if (!schlick) exact = select(specular_workflow, F(0.f), F(1.f - metallic));
    }
    if constexpr (kMetal || kStraight)
      diffuse_ = diffuse_ * F(F(1.f - metallic) * (kStraight ? params.opacity : F(1.f)));
    if constexpr (kStraight) {
      transparency_ = F(1.f - params.opacity);
      most_passing_ = most_passing<F>(params.flags);
    }
    interface_ = CoatFresnel<F>(ior, exact);
    const F alpha = alpha_from_roughness(roughness_);
    smooth_ = alpha < kDeltaAlpha;
    ggx_.alpha = max(alpha, F(kDeltaAlpha));
    lost_ = LostEnergy<F>(ggx_.alpha);
    multiple_ = lost_.tint(interface_.average(f0_));
    if constexpr (kMetal)
      multiple_ = select<F>(smooth_, Color<F>(F(0.f)), multiple_);
    else
      multiple_ = select(smooth_, F(0.f), multiple_);
    // RoughInterface is large, so it is constructed in place.
    std::construct_at(&rough_, interface_, roughness_, ggx_.alpha, lost_, smooth_);
    average_ = rough_.average(f0_, multiple_);
    if constexpr (!kCoat) return;
    clearcoat_ = params.clearcoat;
    coat_roughness_ = params.clearcoat_roughness;
    coat_ = CoatFresnel<F>(ior, F(schlick ? 0.f : 1.f));
    const F coat_alpha = alpha_from_roughness(coat_roughness_);
    coat_smooth_ = coat_alpha < kDeltaAlpha;
    coat_ggx_.alpha = max(coat_alpha, F(kDeltaAlpha));
    if (has_coat()) {
      coat_lost_ = LostEnergy<F>(coat_ggx_.alpha);
      rough_coat_ =
          RoughInterface<F>(coat_, coat_roughness_, coat_ggx_.alpha, coat_lost_, coat_smooth_);
    }
  }

  /// Returns the fraction of light that passes straight through all layers at cosine z >= 0:
  ///   T(z) = (1 - opacity) (1 - E_specular(z)) (1 - E_coat(z)),   E the directional albedos.
  Color<F> straight(const F& z) const {
    if constexpr (!kStraight) return Color<F>(F(0.f));
    const F below = has_coat() ? F(1.f - coat_albedo(z)) : F(1.f);
    return (Color<F>(F(1.f)) - Color<F>(specular_albedo(z))) * F(below * transparency_);
  }

  /// Returns the probability with which ray traversal lets rays pass layers that transmit the
  /// fraction `straight`: its smallest component, with a limit for emissive surfaces. The BSDF
  /// transmits the rest.
  F passing_probability(const Color<F>& straight) const {
    return wavecomb::passing_probability<F>(straight, most_passing_);
  }

 protected:
  /// Returns whether any lane has a clearcoat.
  bool has_coat() const {
    if constexpr (kCoat) return any(Mask<F>(clearcoat_ > 0.f));
    return false;
  }
  F coat_albedo(const F& z) const {
    const F lost = select(coat_smooth_, F(0.f), coat_lost_(z));
    return clearcoat_ * rough_coat_.albedo(coat_.f0_exact, F(0.f), z, lost);
  }
  Tint specular_albedo(const F& z) const {
    return rough_.albedo(f0_, multiple_, z, select(smooth_, F(0.f), lost_(z)));
  }

  F roughness_, coat_roughness_, clearcoat_, transparency_, most_passing_;
  CoatFresnel<F> coat_, interface_;
  Tint f0_, average_, multiple_;
  Color<F> diffuse_;
  LostEnergy<F> lost_, coat_lost_;
  RoughInterface<F> rough_, rough_coat_;
  Ggx<F> ggx_, coat_ggx_;
  Mask<F> smooth_, coat_smooth_;
};

}  // namespace wavecomb
