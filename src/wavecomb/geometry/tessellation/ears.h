// SPDX-License-Identifier: Apache-2.0
/// Triangulation of arbitrary polygons by ear clipping.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

namespace wavecomb {

/// Triangulation of a polygon.
struct PolygonTriangulation {
  /// Corner indices, 3 per triangle. A polygon with n corners is divided into n - 2 triangles.
  std::vector<int64_t> corners;
  /// Number of corners that were cut without an ear test after the step limit was reached.
  uint64_t untested = 0;
};

/// Maximum number of steps of `clip_ears()`; this number of steps takes about a second. In the
/// worst known cases, a face with 100,000 corners needs two thirds of this number, and a face with
/// 5,000 corners needs one fiftieth.
inline constexpr uint64_t kMaxClippingSteps = uint64_t{1} << 26;

/// Triangulates a counter-clockwise polygon in the plane by clipping ears, starting at its first
/// corner (G. Meisters, "Polygons Have Ears", 1975). A corner is an ear if no other remaining
/// corner lies in or on its triangle. Corners that coincide with a vertex of the triangle do not
/// count, since they occur where holes are joined to the outline. If no ear is left, the polygon
/// intersects itself, and the next corner is cut regardless.
///
/// After a failed test, a corner is tested again only if one of its neighbours changes or the
/// corner that blocked it is removed. A k-d tree finds blocking corners. In the worst known cases,
/// including self-intersecting polygons, n corners take O(n sqrt(n)) steps.
///
/// `flat` holds x and y of each corner. If a coordinate is not finite, the result is a triangle
/// fan. After `max_steps` steps, the remaining corners are cut without testing whether they are
/// ears.
PolygonTriangulation clip_ears(std::span<const double> flat,
                               uint64_t max_steps = kMaxClippingSteps);

}  // namespace wavecomb
