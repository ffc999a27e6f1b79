// SPDX-License-Identifier: Apache-2.0
/// Sorting of rays before traversal, by properties of the rays alone.
#pragma once

#include <cstddef>
#include <cstdint>

#include "wavecomb/core/settings_choices.h"

namespace wavecomb {

/// Bounding box in which ray origins are quantised to Morton codes of 10 bits per axis.
struct OrderGrid {
  float lo[3] = {0, 0, 0};
  float scale[3] = {1, 1, 1};  ///< 1024 / extent
};

/// Number of distinct direction keys.
inline constexpr uint32_t kDirectionKeys = 64;

/// Writes the n slots in ascending key order by counting sort; equal keys keep their input order.
void sort_by_direction(const uint32_t* key, const uint32_t* slot, size_t n, uint32_t* sorted);

}  // namespace wavecomb
