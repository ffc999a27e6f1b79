// SPDX-License-Identifier: Apache-2.0
/// Table of the inputs of the program "openpbr", except for the inputs that all programs share.
/// Descriptions, checks, records, parameters at hits, graph outputs and Python names are derived
/// from the table.
#pragma once

#include <cstdint>
#include <tuple>

#include "wavecomb/core/rows/fields.h"
#include "wavecomb/core/vec3.h"

/// List of inputs as X(kind, name, default, minimum, maximum), in the order in which OpenPbrRecord
/// and the outputs of value graphs store them. Default values follow OpenPBR Surface 1.1, except
/// for the inputs that are weights. Inputs of kind Derived are colours that kernels and graphs use,
/// but that callers cannot set: they are computed from other parameters.
///
///   specular_weight        scales the reflectance at normal incidence
///   anisotropy, rotation   of specular roughness; rotation in turns from the tangent towards the
///                          bitangent
///   transmission_tint      factor of each crossing of the surface
///   extinction             coefficient inside, per unit of length
///   subsurface_...         subsurface scattering: a random walk if a radius is given
///                          (medium/description/subsurface.h), else diffuse; thin walls transmit a
///                          fraction of (1 + anisotropy) / 2
///   film_thickness         nanometres
#define WAVECOMB_OPENPBR_INPUTS(X)           \
  X(Number, diffuse_roughness, 0, 0, 1)      \
  X(Number, specular_weight, 1, 0, 100)      \
  X(Number, anisotropy, 0, 0, 1)             \
  X(Number, rotation, 0, 0, 1)               \
  X(Number, transmission_weight, 0, 0, 1)    \
  X(Derived, transmission_tint, 1, 0, 1)     \
  X(Derived, extinction, 0, 0, 1e6f)         \
  X(Number, subsurface_weight, 0, 0, 1)      \
  X(Colour, subsurface_color, 0.8f, 0, 1)    \
  X(Number, subsurface_anisotropy, 0, -1, 1) \
  X(Number, fuzz_weight, 0, 0, 1)            \
  X(Colour, fuzz_color, 1, 0, 1)             \
  X(Number, fuzz_roughness, 0.5f, 0, 1)      \
  X(Colour, coat_color, 1, 0, 1)             \
  X(Number, coat_ior, 1.6f, 0.1f, 10)        \
  X(Number, coat_darkening, 1, 0, 1)         \
  X(Number, film_weight, 0, 0, 1)            \
  X(Number, film_thickness, 500, 0, 1e5f)    \
  X(Number, film_ior, 1.4f, 1, 10)

namespace wavecomb {

namespace detail {

template <typename... T>
constexpr std::tuple<T&...> tie_rest(int /*first*/, T&... rest) {
  return std::tie(rest...);
}

}  // namespace detail

/// One member for each input.
template <typename F>
struct OpenPbrInputs {
  using Number = F;
  using Colour = Vec3<F>;
  using Derived = Vec3<F>;
#define WAVECOMB_MEMBER(kind, name, standard, least, most) kind name;
  WAVECOMB_OPENPBR_INPUTS(WAVECOMB_MEMBER)
#undef WAVECOMB_MEMBER

#define WAVECOMB_NAME(kind, name, standard, least, most) , name
  WAVECOMB_INLINE constexpr auto fields() {
    return detail::tie_rest(0 WAVECOMB_OPENPBR_INPUTS(WAVECOMB_NAME));
  }
  WAVECOMB_INLINE constexpr auto fields() const {
    return detail::tie_rest(0 WAVECOMB_OPENPBR_INPUTS(WAVECOMB_NAME));
  }
#undef WAVECOMB_NAME
};

/// OpenPBR inputs of a material, set by callers of SceneBuilder.
struct OpenPbr : OpenPbrInputs<float> {
  /// If `transmission_depth` is above 0, `transmission_color` is the transmittance over that
  /// distance inside the object. Otherwise the colour tints light at each crossing of the surface.
  Vec3<float> transmission_color{1, 1, 1};
  float transmission_depth = 0;
  /// Scattering coefficient inside the solid, multiplied by transmission_depth, and the mean cosine
  /// of the scattering angle (medium/description/mesh_medium.h).
  Vec3<float> transmission_scatter{0, 0, 0};
  float transmission_scatter_anisotropy = 0;
  /// Where transmissive solids overlap, light travels in the medium with the highest priority.
  float nested_priority = 0;
  /// Mean free paths below the surface for each channel, in units of length. 0 means that light
  /// leaves at the point where it entered.
  Vec3<float> subsurface_radius{0, 0, 0};
  bool thin_walled = false;

  OpenPbr() : OpenPbrInputs<float>{} {
#define WAVECOMB_DEFAULT(kind, name, standard, least, most) name = kind(float{standard});
    WAVECOMB_OPENPBR_INPUTS(WAVECOMB_DEFAULT)
#undef WAVECOMB_DEFAULT
  }
};

/// Packed OpenPBR inputs of 128 bytes.
struct alignas(64) OpenPbrRecord : OpenPbrInputs<float> {
  float thin_walled;  ///< 0 or 1
  float subsurface;   ///< SubsurfaceKind
  float pad;
};
static_assert(sizeof(OpenPbrRecord) == 128);

}  // namespace wavecomb
