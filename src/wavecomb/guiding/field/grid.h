// SPDX-License-Identifier: Apache-2.0
/// Grid over the bounds of the scene. The guiding field represents positions as grid coordinates.
#pragma once

#include <array>
#include <cstdint>

#include "wavecomb/guiding/field/field_view.h"

namespace wavecomb {

/// Grid that divides the bounds of the scene into 2^kGuidingBits steps per axis.
struct GuidingGrid {
  float lo[3] = {}, scale[3] = {};

  /// `low` and `high` are the corners of the bounds, with low <= high.
  GuidingGrid(const float (&low)[3], const float (&high)[3]);
};

/// Returns the Morton code of the grid position of p.
uint32_t grid_code(const GuidingGrid& grid, const float (&p)[3]);

/// Returns the grid position of a Morton code, in steps along x, y and z.
std::array<uint32_t, 3> grid_position(uint32_t code);

}  // namespace wavecomb
