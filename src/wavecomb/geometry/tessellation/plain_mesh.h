// SPDX-License-Identifier: Apache-2.0
/// Fast path for plain meshes, which have only triangles or only quads, valid indices, and points
/// with moderate coordinates. All other meshes use the general code path, which reports errors.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

namespace wavecomb {

/// Lowest and highest coordinates of a set of points.
using PointBounds = std::array<std::array<float, 3>, 2>;

/// Transforms points in double precision: x' = x m00 + y m10 + z m20 + m30. Each sum uses fma for
/// all products except the first, as a BLAS matrix product does.
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

/// Sets the flag in `used` of each point that triangles use; returns the number of points whose
/// flag was 0. Throws Error if an index is out of range.
size_t mark_used_points(std::span<const uint32_t> triangles, std::span<uint8_t> used);

/// A plain mesh in the space of its group.
struct PlainMesh {
  uint32_t corners_per_face = 0;    ///< 3 or 4
  std::vector<float> positions;     ///< 3 floats per point; empty if the transform is the identity
  std::vector<int64_t> split;       ///< result of `split_quads`; empty for triangles
  std::vector<uint32_t> triangles;  ///< point indices for `split`; empty for triangles
  PointBounds bounds;
};

/// Converts a mesh, or returns nothing if it is not plain.
///
/// `points`: 3 per point. `counts`: corners of each face. `indices`: point of each corner.
/// `matrix`: 4 x 4, for row vectors. Bounds are limited as in `bounds_of`.
std::optional<PlainMesh> make_plain_mesh(std::span<const float> points,
                                         std::span<const int32_t> counts,
                                         std::span<const int32_t> indices,
                                         std::span<const double, 16> matrix, double limit);

/// Several plain meshes, one after another in common arrays.
struct PlainMeshes {
  std::vector<float> positions;           ///< 3 per point
  std::vector<uint32_t> triangles;        ///< 3 per triangle, relative to the mesh's first point
  std::vector<uint32_t> triangle_counts;  ///< 1 per mesh
  std::vector<PointBounds> bounds;        ///< 1 per mesh
  std::vector<uint8_t> uses_all_points;   ///< 1 per mesh: whether the triangles use all points
};

/// Numbers of elements of one mesh in the common arrays.
struct MeshSizes {
  uint32_t points, faces, corners;
};

/// Converts meshes up to the first one that is not plain.
///
/// `points`, `counts` and `indices` hold one mesh after another and have the sizes that `sizes`
/// adds up to. `matrices`: 16 numbers per mesh. The other arguments have the same meaning as in
/// `make_plain_mesh`.
PlainMeshes make_plain_meshes(std::span<const float> points, std::span<const int32_t> counts,
                              std::span<const int32_t> indices, std::span<const MeshSizes> sizes,
                              std::span<const double> matrices, double limit);

}  // namespace wavecomb
