// SPDX-License-Identifier: Apache-2.0
/// The names of all programs, in the order of ProgramId. Who includes this knows that there are
/// programs, and nothing of what they are: a change in one of them compiles none of his units.
#pragma once

#include <cstddef>
#include <string_view>
#include <tuple>
#include <type_traits>

#include "wavecomb/scene/material_parts.h"

namespace wavecomb {

template <typename F>
class DiffuseBsdf;
template <typename F>
class MetalBsdf;
template <typename F>
class DielectricBsdf;
template <typename F>
class PlasticBsdf;
template <typename F>
class EmissiveBsdf;
template <typename F, uint32_t kParts = kAllParts>
class PrincipledBsdf;
template <typename F, uint32_t kParts = kAllParts>
class OpenPbrBsdf;

template <typename... Bsdf>
struct ProgramList {
  static constexpr size_t kSize = sizeof...(Bsdf);
};

template <typename F>
using Programs = ProgramList<DiffuseBsdf<F>, MetalBsdf<F>, DielectricBsdf<F>, PlasticBsdf<F>,
                             EmissiveBsdf<F>, PrincipledBsdf<F>, OpenPbrBsdf<F>>;
static_assert(Programs<float>::kSize == kProgramCount);

namespace detail {
template <typename Wanted, typename... Bsdf>
constexpr size_t place_of(ProgramList<Bsdf...>) {
  size_t i = 0;
  (void)((std::is_same_v<Wanted, Bsdf> || (++i, false)) || ...);
  return i;
}
template <size_t I, typename... Bsdf>
std::tuple_element_t<I, std::tuple<Bsdf...>> program_at(ProgramList<Bsdf...>);
}  // namespace detail

/// The id of a program: what it says itself where it is none of the list.
template <typename Bsdf, typename F>
constexpr size_t id_of() {
  constexpr size_t kPlace = detail::place_of<Bsdf>(Programs<F>{});
  if constexpr (kPlace < kProgramCount)
    return kPlace;
  else
    return static_cast<size_t>(Bsdf::kProgram);
}

/// The class of program `kId`.
template <ProgramId kId, typename F>
using Program = decltype(detail::program_at<static_cast<size_t>(kId)>(Programs<F>{}));

namespace detail {
template <uint32_t kVariant, typename F>
auto variant_class() {
  constexpr ProgramId kId = program_of(kVariant);
  constexpr uint32_t kParts = kVariants[kVariant].parts;
  if constexpr (kParts == kAllParts)
    return std::type_identity<Program<kId, F>>();
  else if constexpr (kId == ProgramId::kPrincipled)
    return std::type_identity<PrincipledBsdf<F, kParts>>();
  else
    return std::type_identity<OpenPbrBsdf<F, kParts>>();
}
}  // namespace detail

/// The class of a variant.
template <uint32_t kVariant, typename F>
using VariantBsdf = typename decltype(detail::variant_class<kVariant, F>())::type;

}  // namespace wavecomb
