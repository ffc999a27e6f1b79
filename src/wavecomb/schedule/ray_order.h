// SPDX-License-Identifier: Apache-2.0
/// Orders of rays before traversal. They are made from the rays alone.
#pragma once

#include <cstdint>

#include "wavecomb/core/settings.h"
#include "wavecomb/schedule/ray_queue.h"

namespace wavecomb {

/// The box that origins are quantised in, for Morton codes of 10 bits an axis.
struct OrderGrid {
  float lo[3] = {0, 0, 0};
  float scale[3] = {1, 1, 1};  ///< 1024 / extent
};

/// Moves the columns of `from` into `to` by `order`; both have the same columns.
void permute(const RayQueue& from, RayQueue& to, const uint32_t* order, size_t n);
void permute(const ShadowQueue& from, ShadowQueue& to, const uint32_t* order, size_t n);

}  // namespace wavecomb
