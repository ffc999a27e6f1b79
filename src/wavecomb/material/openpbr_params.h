// SPDX-License-Identifier: Apache-2.0
/// Parameters of program "openpbr" at hits.
#pragma once

#include <algorithm>
#include <array>

#include "wavecomb/material/description/openpbr_inputs.h"
#include "wavecomb/material/params.h"
#include "wavecomb/medium/description/subsurface.h"

namespace wavecomb {

/// Inputs of OpenPBR that may read textures, except emission and opacity.
inline constexpr uint32_t kOpenPbrInputs =
    input_bit(Input::kBaseColor) | input_bit(Input::kSpecularColor) | input_bit(Input::kRoughness) |
    input_bit(Input::kMetallic) | input_bit(Input::kClearcoat) |
    input_bit(Input::kClearcoatRoughness) | input_bit(Input::kNormal) | kNeedsTangent;

/// Parameters of the program "openpbr" at a hit. ShadingParams holds the inputs shared with other
/// programs: `roughness` is the specular roughness, and `clearcoat` and `clearcoat_roughness` are
/// the coat's weight and roughness. The struct OpenPbr (material/description/openpbr_inputs.h)
/// documents the parameters.
template <typename F>
struct OpenPbrParams : ShadingParams<F>, OpenPbrInputs<F> {
  F thin_walled;        ///< 0 or 1
  F subsurface;         ///< SubsurfaceKind of the subsurface random walk
  const float* energy;  ///< EnergyTables

  /// Evaluates the parameters at a hit, with the same arguments as fetch_params().
  template <uint32_t kInputs, bool kGraphs = true, typename MakePoint>
  static OpenPbrParams fetch(const MaterialView& view, const UInt<F>& material, const Vec2<F>& uv,
                             const Footprint<F>& footprint, const MakePoint& make_point,
                             const Mask<F>& active);

  /// Transmittance over a distance `t` inside the material; 1 for rays outside. `view_cosine` is
  /// the cosine between the normal and wo: negative inside.
  Color<F> transmittance(const F& t, const F& view_cosine) const {
    const Mask<F> inside =
        (view_cosine < 0.f) & (this->transmission_weight > 0.f) & (thin_walled < 0.5f);
    const Color<F>& extinction = this->extinction;
    const F length = select(inside, t, F(0.f));
    return {exp(F(-extinction.x * length)), exp(F(-extinction.y * length)),
            exp(F(-extinction.z * length))};
  }
};

/// Pointers to the components of `p` in the order of GraphParameter.
template <typename F>
inline std::array<F*, kGraphOutputCount> parameter_pointers(OpenPbrParams<F>& p) {
  std::array<F*, kGraphOutputCount> all;
  const auto inputs = parameter_pointers(static_cast<ShadingParams<F>&>(p));
  std::copy(inputs.begin(), inputs.end(), all.begin());
  detail::for_each_word<0, F>(static_cast<OpenPbrInputs<F>&>(p),
                              [&](auto at, F& value) { all[kFirstOpenPbrOutput + at] = &value; });
  return all;
}

template <typename F>
template <uint32_t kInputs, bool kGraphs, typename MakePoint>
inline OpenPbrParams<F> OpenPbrParams<F>::fetch(const MaterialView& view, const UInt<F>& material,
                                                const Vec2<F>& uv, const Footprint<F>& footprint,
                                                const MakePoint& make_point,
                                                const Mask<F>& active) {
  using R = OpenPbrRecord;
  OpenPbrParams p;
  static_cast<ShadingParams<F>&>(p) =
      detail::evaluate_params<kInputs, F>(view, material, uv, footprint, active);
  const bool uniform = any(active) && is_uniform<F>(material, active);
  const UInt<F> record = detail::make_reader<MaterialRecord, F>(view.materials, material, uniform,
                                                                active)[&MaterialRecord::openpbr];
  const auto r = detail::make_reader<R, F>(view.openpbr, record, uniform, active);
  static_cast<OpenPbrInputs<F>&>(p) = r.template row<OpenPbrInputs>();
  p.thin_walled = r[&R::thin_walled];
  p.subsurface = r[&R::subsurface];
  p.energy = view.energy;
  if constexpr (kGraphs) complete_params<F>(view, material, make_point, active, p);
  return p;
}

}  // namespace wavecomb
