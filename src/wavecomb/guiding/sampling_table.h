// SPDX-License-Identifier: Apache-2.0
/// Conversion of a region's distribution to the table that kernels sample.
#pragma once

#include <cstdint>
#include <span>

#include "wavecomb/guiding/field/field_view.h"

namespace wavecomb {

/// Writes the sampling table of a distribution over bins, which are ordered by rows of the
/// equal-area square. Weights must be finite and not negative. Each bin gets at least one of the
/// 65536 values of its row, so no density is 0. The sampling table is uniform if all weights are 0.
void write_guiding_table(std::span<const double, kGuidingBins> weights,
                         std::span<uint32_t, kGuidingWords> table);

}  // namespace wavecomb
