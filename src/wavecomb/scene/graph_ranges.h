// SPDX-License-Identifier: Apache-2.0
/// Between what the results of value graphs lie.
#pragma once

#include <array>
#include <limits>
#include <optional>
#include <span>

#include "wavecomb/graph/parameters.h"
#include "wavecomb/texture/texture.h"

namespace wavecomb {

/// All that a value may be: low <= value <= high, or NaN.
struct ValueRange {
  float low = -std::numeric_limits<float>::infinity();
  float high = std::numeric_limits<float>::infinity();
  bool nan = true;
};

/// By component of GraphParameter: what a program may drive it to, in its own range and never NaN;
/// nothing where it does not drive it.
using DrivenRanges = std::array<std::optional<ValueRange>, kGraphOutputCount>;

/// Ranges of what program `graph` (kNoGraph: none) gives, whatever the hit is. Sound, and not the
/// least: operands are taken for independent, and what is no plain arithmetic may be anything.
DrivenRanges driven_ranges(const GraphSet& graphs, uint32_t graph,
                           std::span<const TexturePtr> textures);

}  // namespace wavecomb
