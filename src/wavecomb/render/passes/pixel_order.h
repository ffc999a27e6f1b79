// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "wavecomb/core/settings.h"

namespace wavecomb {

/// Returns the pixels of a region (x | y << 16) in Morton order, so that each wave covers a compact
/// patch.
std::vector<uint32_t> morton_pixel_order(const Region& region);

}  // namespace wavecomb
