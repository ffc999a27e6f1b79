// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/render/passes/pixel_order.h"

#include "wavecomb/core/encoding/morton.h"

namespace wavecomb {

std::vector<uint32_t> morton_pixel_order(const Region& region) {
  std::vector<uint32_t> order;
  order.reserve(region.pixels());
  // The order visits blocks of 64 x 64 pixels row by row, and follows a Morton curve in each block.
  // Pixels of a block outside the region are skipped.
  constexpr uint32_t kBlock = 64;
  for (uint32_t by = region.y0 / kBlock * kBlock; by < region.y1; by += kBlock)
    for (uint32_t bx = region.x0 / kBlock * kBlock; bx < region.x1; bx += kBlock)
      for (uint32_t m = 0; m < kBlock * kBlock; ++m) {
        const uint32_t x = bx + compact_bits_2(m), y = by + compact_bits_2(m >> 1);
        if (region.contains(x, y)) order.push_back(x | (y << 16));
      }
  return order;
}

}  // namespace wavecomb
