// SPDX-License-Identifier: Apache-2.0
/// Interval arithmetic that bounds the results of value graphs.
#pragma once

#include <array>
#include <limits>
#include <optional>
#include <span>

#include "wavecomb/graph/parameters/parameters.h"
#include "wavecomb/texture/texture.h"

namespace wavecomb {

/// Interval of a value: low <= value <= high, or NaN if `nan` is set.
struct ValueRange {
  float low = -std::numeric_limits<float>::infinity();
  float high = std::numeric_limits<float>::infinity();
  bool nan = true;
};

/// Range of values that a graph can write to each component of GraphParameter. Ranges are clamped
/// to the limits of the parameter and never include NaN. The entry of a component that the graph
/// does not drive is empty.
using DrivenRanges = std::array<std::optional<ValueRange>, kGraphOutputCount>;

/// Computes the ranges of the outputs of graph program `graph` (kNoGraph for none) over all hits.
/// The ranges are conservative: operands are assumed independent, and the result of any operation
/// other than plain arithmetic is unbounded.
DrivenRanges driven_ranges(const GraphSet& graphs, uint32_t graph,
                           std::span<const TexturePtr> textures);

}  // namespace wavecomb
