// SPDX-License-Identifier: Apache-2.0
/// Forward declarations of all surface programs, in the order of ProgramId. A source file that
/// includes only this header is not recompiled when a program changes.
#pragma once

#include <cstddef>
#include <string_view>
#include <tuple>
#include <type_traits>

#include "wavecomb/material/description/variants.h"

namespace wavecomb {

#define WAVECOMB_WHOLE(name, Class, ...) \
  template <typename F>                  \
  class Class##Bsdf;
#define WAVECOMB_IN_PARTS(name, Class, ...)          \
  template <typename F, uint32_t kParts = kAllParts> \
  class Class##Bsdf;
WAVECOMB_PROGRAMS(WAVECOMB_WHOLE, WAVECOMB_IN_PARTS)
#undef WAVECOMB_WHOLE
#undef WAVECOMB_IN_PARTS

template <typename... Bsdf>
struct ProgramList {
  static constexpr size_t kSize = sizeof...(Bsdf);
};

namespace detail {
/// Removes the first entry of a program list. The entry `void` is a placeholder, so that the macro
/// in `Programs` can put a comma before each program.
template <typename First, typename... Bsdf>
ProgramList<Bsdf...> list_behind(ProgramList<First, Bsdf...>);
}  // namespace detail

template <typename F>
using Programs = decltype(detail::list_behind(
    ProgramList<void
#define WAVECOMB_PROGRAM(name, Class, ...) , Class##Bsdf<F>
                    WAVECOMB_PROGRAMS(WAVECOMB_PROGRAM, WAVECOMB_PROGRAM)
#undef WAVECOMB_PROGRAM
                >()));
static_assert(Programs<float>::kSize == kSurfaceProgramCount);

namespace detail {
template <typename Wanted, typename... Bsdf>
constexpr size_t program_index(ProgramList<Bsdf...>) {
  size_t i = 0;
  (void)((std::is_same_v<Wanted, Bsdf> || (++i, false)) || ...);
  return i;
}
template <size_t I, typename... Bsdf>
std::tuple_element_t<I, std::tuple<Bsdf...>> program_at(ProgramList<Bsdf...>);
}  // namespace detail

namespace detail {
template <typename Last, typename... Bsdf>
ProgramList<Bsdf..., Last> list_before(ProgramList<Bsdf...>);
}  // namespace detail

/// The program list `List` with the program `Last` appended.
template <typename List, typename Last>
using AppendedProgram = decltype(detail::list_before<Last>(List{}));

/// Id of a program: its position in `Programs`, or `Bsdf::kProgram` for a class that is not in
/// `Programs`.
template <typename Bsdf, typename F>
constexpr size_t id_of() {
  constexpr size_t kProgramIndex = detail::program_index<Bsdf>(Programs<F>{});
  if constexpr (kProgramIndex < kSurfaceProgramCount)
    return kProgramIndex;
  else
    return static_cast<size_t>(Bsdf::kProgram);
}

/// Class of program `kId`.
template <ProgramId kId, typename F>
using Program = decltype(detail::program_at<static_cast<size_t>(kId)>(Programs<F>{}));

namespace detail {
template <uint32_t kVariant, typename F>
auto variant_class() {
  [[maybe_unused]] constexpr ProgramId kId = program_of(kVariant);
  [[maybe_unused]] constexpr uint32_t kParts = kVariants[kVariant].parts;
#define WAVECOMB_WHOLE(name, Class, ...)
#define WAVECOMB_IN_PARTS(name, Class, ...)                        \
  if constexpr (kParts != kAllParts && kId == ProgramId::k##Class) \
    return std::type_identity<Class##Bsdf<F, kParts>>();           \
  else
  WAVECOMB_PROGRAMS(WAVECOMB_WHOLE, WAVECOMB_IN_PARTS)
  return std::type_identity<Program<kId, F>>();
#undef WAVECOMB_WHOLE
#undef WAVECOMB_IN_PARTS
}
}  // namespace detail

/// Class of a kernel variant.
template <uint32_t kVariant, typename F>
using VariantBsdf = typename decltype(detail::variant_class<kVariant, F>())::type;

}  // namespace wavecomb
