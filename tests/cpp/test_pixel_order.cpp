// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/render/passes/pixel_order.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>

namespace wavecomb {
namespace {

TEST(PixelOrder, EveryPixelOnce) {
  constexpr std::array<std::array<uint32_t, 2>, 9> kSizes = {
      {{1, 1}, {1, 200}, {200, 1}, {64, 64}, {65, 63}, {130, 70}, {3, 5}, {65535, 1}, {1, 65535}}};
  for (const auto& [width, height] : kSizes) {
    const std::vector<uint32_t> order = morton_pixel_order({0, 0, width, height});
    ASSERT_EQ(order.size(), size_t{width} * height);
    std::vector<bool> seen(order.size(), false);
    for (const uint32_t p : order) {
      const uint32_t x = p & 0xffffu, y = p >> 16;
      ASSERT_LT(x, width);
      ASSERT_LT(y, height);
      const size_t i = size_t{y} * width + x;
      ASSERT_FALSE(seen[i]);
      seen[i] = true;
    }
  }
}

TEST(PixelOrder, RunsAreCompact) {
  const std::vector<uint32_t> order = morton_pixel_order({0, 0, 256, 192});
  for (size_t first = 0; first < order.size(); first += 256) {
    uint32_t lo_x = ~0u, lo_y = ~0u, hi_x = 0, hi_y = 0;
    for (size_t i = first; i < first + 256; ++i) {
      lo_x = std::min(lo_x, order[i] & 0xffffu);
      hi_x = std::max(hi_x, order[i] & 0xffffu);
      lo_y = std::min(lo_y, order[i] >> 16);
      hi_y = std::max(hi_y, order[i] >> 16);
    }
    EXPECT_EQ(hi_x - lo_x, 15u);
    EXPECT_EQ(hi_y - lo_y, 15u);
  }
}

}  // namespace
}  // namespace wavecomb
