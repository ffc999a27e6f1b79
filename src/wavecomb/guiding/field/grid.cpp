// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/guiding/field/grid.h"

#include <cmath>

#include "wavecomb/core/encoding/morton.h"
#include "wavecomb/guiding/lookup.inl"

namespace wavecomb {
namespace {

/// Extracts every third bit of a Morton code, starting with the lowest.
uint32_t compact_bits_3(uint32_t x) {
  uint32_t out = 0;
  for (uint32_t i = 0; i < kGuidingBits; ++i) out |= (x >> (3 * i) & 1u) << i;
  return out;
}

}  // namespace

GuidingGrid::GuidingGrid(const float (&low)[3], const float (&high)[3]) {
  for (int i = 0; i < 3; ++i) {
    const double size = double{high[i]} - double{low[i]};
    lo[i] = low[i];
    scale[i] =
        size > 0 && std::isfinite(size) ? static_cast<float>((1u << kGuidingBits) / size) : 0;
  }
}

uint32_t grid_code(const GuidingGrid& grid, const float (&p)[3]) {
  uint32_t step[3];
  for (int i = 0; i < 3; ++i)
    step[i] = detail::guiding_steps<float>(p[i], grid.lo[i], grid.scale[i]);
  return morton_3(step[0], step[1], step[2]);
}

std::array<uint32_t, 3> grid_position(uint32_t code) {
  return {compact_bits_3(code), compact_bits_3(code >> 1), compact_bits_3(code >> 2)};
}

}  // namespace wavecomb
