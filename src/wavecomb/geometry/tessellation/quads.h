// SPDX-License-Identifier: Apache-2.0
/// Triangulation of quads.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

namespace wavecomb {

/// Splits each quad into two triangles; returns their corners, 6 per quad.
///
/// Chooses the diagonal for which the smaller of the two triangle areas is larger. The area of a
/// triangle that faces away from the quad's normal counts as negative. If both diagonals are
/// equally good, chooses the diagonal through the first corner.
///
/// `points`: 3 coordinates per point. `indices`: point index of each corner, which must be in
/// range. `starts`: index of the first corner of each quad, whose other corners follow it; empty if
/// all faces are quads.
std::vector<int64_t> split_quads(std::span<const float> points, std::span<const int32_t> indices,
                                 std::span<const int64_t> starts);

}  // namespace wavecomb
