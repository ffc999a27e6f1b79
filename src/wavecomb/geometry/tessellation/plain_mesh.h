// SPDX-License-Identifier: Apache-2.0
/// Fast path for common meshes: all triangles or all quads, indices in range, points at moderate
/// coordinates. All other meshes use the general code path, which reports errors.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

namespace wavecomb {

/// Lowest and highest coordinates of a set of points.
using PointBounds = std::array<std::array<float, 3>, 2>;

/// Transforms points in double precision: x' = x m00 + y m10 + z m20 + m30. All products but the
/// first use fma, as a BLAS matrix product does.
///
/// `points`, `out`: 3 per point. `matrix`: 4 x 4, for row vectors.
void bake_points(std::span<const float> points, std::span<const double, 16> matrix,
                 std::span<float> out);

/// Transforms normals by the inverse transpose, in double precision, and normalises them.
///
/// `normals`, `out`: 3 per normal. `inverse`: 4 x 4 inverse of the transform of the points, for row
/// vectors.
void bake_normals(std::span<const float> normals, std::span<const double, 16> inverse,
                  std::span<float> out);

/// Computes the bounds of points. Returns nothing if there is no point, if a coordinate is NaN, or
/// if its magnitude is `limit` or more.
std::optional<PointBounds> bounds_of(std::span<const float> points, double limit);

/// Returns 3 if all faces are triangles, 4 if all are quads, and otherwise 0. Also returns 0 if
/// there are no faces, if `counts` do not add up to the number of `indices`, or if an index is not
/// below `point_count`.
uint32_t corners_of_faces(std::span<const int32_t> counts, std::span<const int32_t> indices,
                          size_t point_count);

}  // namespace wavecomb
