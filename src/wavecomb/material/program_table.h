// SPDX-License-Identifier: Apache-2.0
/// Definitions of all programs, for tests. Kernels do not need this header, since each is compiled
/// for a single program.
#pragma once

#include "wavecomb/material/program_list.h"
#include "wavecomb/material/programs/dielectric.h"
#include "wavecomb/material/programs/diffuse.h"
#include "wavecomb/material/programs/emissive.h"
#include "wavecomb/material/programs/hair.h"
#include "wavecomb/material/programs/metal.h"
#include "wavecomb/material/programs/openpbr.h"
#include "wavecomb/material/programs/plastic.h"
#include "wavecomb/material/programs/principled.h"

namespace wavecomb {

/// Calls `visitor.operator()<Bsdf>()` with the class of program `id`:
///   visit_program<F>(id, [&]<typename Bsdf>() { shade<Bsdf>(batch); });
template <typename F, typename Visitor>
inline void visit_program(ProgramId id, Visitor&& visitor) {
  [&]<typename... Bsdf>(ProgramList<Bsdf...>) {
    (void)((id == Bsdf::kProgram && (visitor.template operator()<Bsdf>(), true)) || ...);
  }(Programs<F>{});
}

}  // namespace wavecomb
