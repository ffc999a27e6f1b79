// SPDX-License-Identifier: Apache-2.0
/// A region's distribution as the table that kernels read.
#pragma once

#include <cstdint>
#include <span>

#include "wavecomb/learn/guide_view.h"

namespace wavecomb {

/// Writes the table of a distribution over bins, row by row of the square; weights are finite and
/// at least 0. Each bin gets one number of 65536 of its row at least, so that no density is 0;
/// all are alike where the weights are 0.
void write_guide_table(std::span<const double, kGuideBins> weights,
                       std::span<uint32_t, kGuideWords> table);

}  // namespace wavecomb
