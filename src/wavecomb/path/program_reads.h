// SPDX-License-Identifier: Apache-2.0
/// Material inputs that each shading program reads, for importers of USD stages.
#pragma once

#include <cstdint>

#include "wavecomb/material/description/programs.h"

namespace wavecomb {

struct ProgramReads {
  uint32_t inputs = 0;  ///< bit i is set if the program reads Input i
  bool ior = false;
  /// Whether the program has parameters that UsdPreviewSurface lacks.
  bool has_more = false;
};

/// This function is defined in the program's compile unit (program.lanes.cpp.in), so that a change
/// to one program recompiles no others.
template <typename Bsdf>
ProgramReads program_reads();

ProgramReads reads_of(ProgramId program);

}  // namespace wavecomb
