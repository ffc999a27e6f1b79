// SPDX-License-Identifier: Apache-2.0
/// Quads as triangles.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

namespace wavecomb {

/// Corners of the two triangles of each quad, 6 per quad in order.
///
/// Each quad is cut along the diagonal whose smaller triangle is the larger of the two, areas
/// signed by the quad's normal; from its first corner where both are alike.
///
/// `points`: 3 per point. `indices`: point of each corner; they must be in range. `starts`: first
/// corner of each quad, whose others follow it; empty: the corners are all those of quads.
std::vector<int64_t> split_quads(std::span<const float> points, std::span<const int32_t> indices,
                                 std::span<const int64_t> starts);

}  // namespace wavecomb
