// SPDX-License-Identifier: Apache-2.0
/// Inputs of the program "openpbr" beyond the inputs that all programs share: one table, from which
/// descriptions, checks, records, parameters at hits, outputs of graphs and Python's names follow.
#pragma once

#include <cstdint>
#include <tuple>

#include "wavecomb/core/fields.h"
#include "wavecomb/core/vec3.h"

/// X(kind, name, default, least, most), in the order of records and of graph outputs. Defaults are
/// those of OpenPBR Surface 1.1, but for the weights of its inputs. A Derived colour is what
/// kernels and graphs have, while callers give what it follows from.
///
///   specular_weight        scales the reflectance at normal incidence
///   anisotropy, rotation   of specular roughness; of the grain, in turns from the tangent towards
///                          the bitangent
///   transmission_tint      of each crossing
///   extinction             of what is inside, one over a unit of length
///   subsurface_...         light that walks below the surface (scene/walk_data.h), where a radius
///                          is given; else diffuse. Of thin walls (1 + anisotropy) / 2 goes through
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

/// A member for each input.
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

/// As callers describe it.
struct OpenPbr : OpenPbrInputs<float> {
  /// Where transmission_depth is above 0, transmission_color is what a path of that length inside
  /// leaves; else it tints each crossing.
  Vec3<float> transmission_color{1, 1, 1};
  float transmission_depth = 0;
  /// What is scattered inside, times 1 / transmission_depth; and its mean cosine
  /// (scene/interior.h).
  Vec3<float> transmission_scatter{0, 0, 0};
  float transmission_scatter_anisotropy = 0;
  /// Where solids that transmit overlap, the one of highest priority is there.
  float nested_priority = 0;
  /// Mean free paths below the surface, by channel, units of length. 0: light leaves where it came
  /// in.
  Vec3<float> subsurface_radius{0, 0, 0};
  bool thin_walled = false;

  OpenPbr() : OpenPbrInputs<float>{} {
#define WAVECOMB_DEFAULT(kind, name, standard, least, most) name = kind(float{standard});
    WAVECOMB_OPENPBR_INPUTS(WAVECOMB_DEFAULT)
#undef WAVECOMB_DEFAULT
  }
};

/// As lanes read it: 32 words.
struct alignas(64) OpenPbrRecord : OpenPbrInputs<float> {
  float thin_walled;  ///< 0 or 1
  float walks;        ///< WalkKind
  float pad;
};
static_assert(sizeof(OpenPbrRecord) == 128);

}  // namespace wavecomb
