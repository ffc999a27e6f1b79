// SPDX-License-Identifier: Apache-2.0
/// Orders of rays before traversal. They are made from the rays alone.
#pragma once

#include <cstddef>
#include <cstdint>

#include "wavecomb/core/settings.h"

namespace wavecomb {

/// The box that origins are quantised in, for Morton codes of 10 bits an axis.
struct OrderGrid {
  float lo[3] = {0, 0, 0};
  float scale[3] = {1, 1, 1};  ///< 1024 / extent
};

/// Keys of directions lie below this.
inline constexpr uint32_t kDirectionKeys = 64;

/// Writes the n slots by ascending key, equal keys in the order in which they come: a counting
/// sort.
void sort_by_direction(const uint32_t* key, const uint32_t* slot, size_t n, uint32_t* sorted);

}  // namespace wavecomb
