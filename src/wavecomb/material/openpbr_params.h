// SPDX-License-Identifier: Apache-2.0
/// The parameters of program "openpbr" at hits.
#pragma once

#include <algorithm>
#include <array>

#include "wavecomb/material/params.h"
#include "wavecomb/scene/openpbr_data.h"

namespace wavecomb {

/// Beside the slots: base_color, metallic, roughness (specular), specular_color, clearcoat and
/// clearcoat_roughness (coat), ior. Meanings are those of OpenPbr.
template <typename F>
struct OpenPbrParams : ShadingParams<F> {
  F diffuse_roughness, specular_weight, anisotropy, rotation;
  F transmission_weight;
  Color<F> transmission_tint, extinction;
  F subsurface_weight;
  Color<F> subsurface_color;
  F subsurface_anisotropy;
  F fuzz_weight;
  Color<F> fuzz_color;
  F fuzz_roughness;
  Color<F> coat_color;
  F coat_ior, coat_darkening, film_weight, film_thickness, film_ior;
  F thin_walled;        ///< 0 or 1
  const float* energy;  ///< EnergyTables
};

/// Where the components of GraphParameter are in `p`, in their order.
template <typename F>
inline std::array<F*, kGraphOutputCount> parameter_places(OpenPbrParams<F>& p) {
  const std::array<F*, kGraphOutputCount - kFirstOpenPbrOutput> own{&p.diffuse_roughness,
                                                                    &p.specular_weight,
                                                                    &p.anisotropy,
                                                                    &p.rotation,
                                                                    &p.transmission_weight,
                                                                    &p.transmission_tint.x,
                                                                    &p.transmission_tint.y,
                                                                    &p.transmission_tint.z,
                                                                    &p.extinction.x,
                                                                    &p.extinction.y,
                                                                    &p.extinction.z,
                                                                    &p.subsurface_weight,
                                                                    &p.subsurface_color.x,
                                                                    &p.subsurface_color.y,
                                                                    &p.subsurface_color.z,
                                                                    &p.subsurface_anisotropy,
                                                                    &p.fuzz_weight,
                                                                    &p.fuzz_color.x,
                                                                    &p.fuzz_color.y,
                                                                    &p.fuzz_color.z,
                                                                    &p.fuzz_roughness,
                                                                    &p.coat_color.x,
                                                                    &p.coat_color.y,
                                                                    &p.coat_color.z,
                                                                    &p.coat_ior,
                                                                    &p.coat_darkening,
                                                                    &p.film_weight,
                                                                    &p.film_thickness,
                                                                    &p.film_ior};
  std::array<F*, kGraphOutputCount> all;
  const auto slots = parameter_places(static_cast<ShadingParams<F>&>(p));
  std::copy(own.begin(), own.end(), std::copy(slots.begin(), slots.end(), all.begin()));
  return all;
}

/// fetch_params for this program.
template <uint32_t kSlots, typename F, typename MakePoint>
inline OpenPbrParams<F> fetch_openpbr(const MaterialView& view, const UInt<F>& material,
                                      const Vec2<F>& uv, const F& uv_width,
                                      const MakePoint& make_point, const Mask<F>& active) {
  using R = OpenPbrRecord;
  OpenPbrParams<F> p;
  static_cast<ShadingParams<F>&>(p) =
      detail::evaluate_params<kSlots, F>(view, material, uv, uv_width, active);
  const bool uniform = any(active) && is_uniform<F>(material, active);
  const UInt<F> record =
      detail::make_reader<MaterialRecord, F>(view.materials, material, uniform, active)
          .bits(offsetof(MaterialRecord, openpbr));
  const auto r = detail::make_reader<R, F>(view.openpbr, record, uniform, active);
  p.diffuse_roughness = r.real(offsetof(R, diffuse_roughness));
  p.specular_weight = r.real(offsetof(R, specular_weight));
  p.anisotropy = r.real(offsetof(R, anisotropy));
  p.rotation = r.real(offsetof(R, rotation));
  p.transmission_weight = r.real(offsetof(R, transmission_weight));
  p.transmission_tint = r.vec3(offsetof(R, transmission_tint));
  p.extinction = r.vec3(offsetof(R, extinction));
  p.subsurface_weight = r.real(offsetof(R, subsurface_weight));
  p.subsurface_color = r.vec3(offsetof(R, subsurface_color));
  p.subsurface_anisotropy = r.real(offsetof(R, subsurface_anisotropy));
  p.fuzz_weight = r.real(offsetof(R, fuzz_weight));
  p.fuzz_color = r.vec3(offsetof(R, fuzz_color));
  p.fuzz_roughness = r.real(offsetof(R, fuzz_roughness));
  p.coat_color = r.vec3(offsetof(R, coat_color));
  p.coat_ior = r.real(offsetof(R, coat_ior));
  p.coat_darkening = r.real(offsetof(R, coat_darkening));
  p.film_weight = r.real(offsetof(R, film_weight));
  p.film_thickness = r.real(offsetof(R, film_thickness));
  p.film_ior = r.real(offsetof(R, film_ior));
  p.thin_walled = r.real(offsetof(R, thin_walled));
  p.energy = view.energy;
  complete_params<kSlots, F>(view, material, make_point, active, p);
  return p;
}

/// What a path's light keeps over a length `t` inside of the material; 1 for rays from outside.
/// `cos_seen` is the cosine between the normal and the way back: negative inside.
template <typename F>
inline Color<F> openpbr_transmittance(const OpenPbrParams<F>& p, const F& t, const F& cos_seen) {
  const Mask<F> inside = (cos_seen < 0.f) & (p.transmission_weight > 0.f) & (p.thin_walled < 0.5f);
  const F length = select(inside, t, F(0.f));
  return {exp(F(-p.extinction.x * length)), exp(F(-p.extinction.y * length)),
          exp(F(-p.extinction.z * length))};
}

}  // namespace wavecomb
