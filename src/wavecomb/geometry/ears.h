// SPDX-License-Identifier: Apache-2.0
/// Polygons of any shape as triangles.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

namespace wavecomb {

/// Triangles of a polygon.
struct Ears {
  std::vector<int64_t> corners;  ///< of each triangle three: count - 2 of them
  uint64_t hurried = 0;          ///< corners that were cut without a look: the steps ran out
};

/// Steps that take about a second; a face of 100,000 corners takes two thirds of them at the worst
/// that is known, one of 5,000 a fiftieth.
inline constexpr uint64_t kEarSteps = uint64_t{1} << 26;

/// Triangles of one polygon in the plane, counter-clockwise, by clipping ears from its first corner
/// on (G. Meisters, "Polygons Have Ears", 1975). An ear has no other corner of what is left of the
/// polygon within or on it, but such as lie on its own three (the bridge to a hole). Where none is
/// left, the polygon crosses itself and the corner that is due is cut anyhow.
///
/// A corner is looked at again only when its neighbours changed or the corner that stood in its way
/// is gone; corners in the way are found by a k-d tree. So a polygon of n corners takes
/// O(n sqrt(n)) steps at the worst that is known, self-crossing ones too.
///
/// `flat`: x and y of each corner. Corners that are not finite, and those that are left after
/// `most_steps`, are cut without a look.
Ears clip_ears(std::span<const double> flat, uint64_t most_steps = kEarSteps);

}  // namespace wavecomb
