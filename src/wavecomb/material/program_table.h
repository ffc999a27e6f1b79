// SPDX-License-Identifier: Apache-2.0
/// All programs, in the order of ProgramId. A new program is one header, one line here and one id.
#pragma once

#include <cstddef>
#include <utility>

#include "wavecomb/material/programs/dielectric.h"
#include "wavecomb/material/programs/diffuse.h"
#include "wavecomb/material/programs/emissive.h"
#include "wavecomb/material/programs/metal.h"
#include "wavecomb/material/programs/openpbr.h"
#include "wavecomb/material/programs/plastic.h"
#include "wavecomb/material/programs/principled.h"

namespace wavecomb {

template <typename... Bsdf>
struct ProgramList {
  static constexpr size_t kSize = sizeof...(Bsdf);
  /// Whether program i of the list has id i, for all i.
  static constexpr bool kOrdered = [] {
    size_t i = 0;
    return ((static_cast<size_t>(Bsdf::kProgram) == i++) && ...);
  }();
};

template <typename F>
using Programs = ProgramList<DiffuseBsdf<F>, MetalBsdf<F>, DielectricBsdf<F>, PlasticBsdf<F>,
                             EmissiveBsdf<F>, PrincipledBsdf<F>, OpenPbrBsdf<F>>;
static_assert(Programs<float>::kSize == kProgramCount && Programs<float>::kOrdered);

/// Calls `visitor.operator()<Bsdf>()` with the class of a list that has the id `id`.
template <typename... Bsdf, typename Visitor>
inline void visit_list(ProgramList<Bsdf...>, ProgramId id, Visitor&& visitor) {
  (void)((id == Bsdf::kProgram && (visitor.template operator()<Bsdf>(), true)) || ...);
}

/// Calls `visitor.operator()<Bsdf>()` with the class of program `id`:
///   visit_program<F>(id, [&]<typename Bsdf>() { shade<Bsdf>(batch); });
template <typename F, typename Visitor>
inline void visit_program(ProgramId id, Visitor&& visitor) {
  visit_list(Programs<F>{}, id, visitor);
}

}  // namespace wavecomb
