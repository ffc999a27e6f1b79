// SPDX-License-Identifier: Apache-2.0
/// What programs read of their materials: what readers of stages have to know of them.
#pragma once

#include <cstdint>

#include "wavecomb/scene/programs.h"

namespace wavecomb {

struct ProgramReads {
  uint32_t inputs = 0;  ///< bit i: Input i
  bool ior = false;
  /// It has a class of parameters of its own, and is told more than UsdPreviewSurface can say.
  bool has_more = false;
};

/// As the unit of the program has it (program.lanes.cpp.in), so that a change in one program
/// compiles no others.
template <typename Bsdf>
ProgramReads program_reads();

ProgramReads reads_of(ProgramId program);

}  // namespace wavecomb
