// SPDX-License-Identifier: Apache-2.0
/// What nearly all meshes are: triangles alone or quads alone, every index in range, every point
/// where it can be drawn. Anything else is for who reads meshes with care, and says what is wrong.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

namespace wavecomb {

/// Lowest and highest coordinates.
using PointBounds = std::array<std::array<float, 3>, 2>;

/// Points under a transform, in double precision: x' = x m00 + y m10 + z m20 + m30, each product
/// but the first added in one rounding, as matrix products have it.
///
/// `points`, `out`: 3 per point. `matrix`: 4 x 4, for row vectors.
void bake_points(std::span<const float> points, std::span<const double, 16> matrix,
                 std::span<float> out);

/// Normals under the inverse transpose of a transform, in double precision as above, of unit
/// length.
///
/// `normals`, `out`: 3 per normal. `inverse`: the transform's, 4 x 4, for row vectors.
void bake_normals(std::span<const float> normals, std::span<const double, 16> inverse,
                  std::span<float> out);

/// The bounds of points; none where a coordinate is not finite, or `limit` or more from the origin.
std::optional<PointBounds> bounds_of(std::span<const float> points, double limit);

/// 3 where all faces are triangles, 4 where all are quads; 0 of anything else, of no faces, and
/// where `counts` do not add up to `indices` or one of these is not below `point_count`.
uint32_t corners_of_faces(std::span<const int32_t> counts, std::span<const int32_t> indices,
                          size_t point_count);

}  // namespace wavecomb
