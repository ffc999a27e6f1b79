// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

namespace wavecomb {

/// All pixels of a picture (x | y << 16) along a Morton curve, so that a wave covers a compact
/// patch.
std::vector<uint32_t> morton_pixel_order(uint32_t width, uint32_t height);

}  // namespace wavecomb
