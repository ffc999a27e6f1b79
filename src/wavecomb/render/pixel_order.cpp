// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/render/pixel_order.h"

#include "wavecomb/core/morton.h"

namespace wavecomb {

std::vector<uint32_t> morton_pixel_order(uint32_t width, uint32_t height) {
  std::vector<uint32_t> order;
  order.reserve(std::size_t{width} * height);
  // Blocks of 64 x 64 by rows, a Morton curve in each: no more than 64 pixels are skipped a side.
  constexpr uint32_t kBlock = 64;
  for (uint32_t by = 0; by < height; by += kBlock)
    for (uint32_t bx = 0; bx < width; bx += kBlock)
      for (uint32_t m = 0; m < kBlock * kBlock; ++m) {
        const uint32_t x = bx + compact_bits_2(m), y = by + compact_bits_2(m >> 1);
        if (x < width && y < height) order.push_back(x | (y << 16));
      }
  return order;
}

}  // namespace wavecomb
