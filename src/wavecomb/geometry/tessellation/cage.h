// SPDX-License-Identifier: Apache-2.0
/// Control cage of a subdivision surface, and face-varying values on its corners.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

namespace wavecomb {

/// UsdGeomMesh::subdivisionScheme.
enum class Scheme : uint8_t { kCatmullClark, kLoop, kBilinear };
/// Values of UsdGeomMesh::interpolateBoundary: none, edgeOnly, edgeAndCorner.
enum class BoundaryRule : uint8_t { kNone, kEdgeOnly, kEdgeAndCorner };
/// Values of UsdGeomMesh::faceVaryingLinearInterpolation, from smooth interpolation everywhere to
/// linear interpolation everywhere.
enum class FaceVaryingRule : uint8_t {
  kNone,
  kCornersOnly,
  kCornersPlus1,
  kCornersPlus2,
  kBoundaries,
  kAll,
};

/// Indices of face-varying values, one for each corner of the cage. Values are continuous between
/// corners of the same vertex if their indices are equal; otherwise, there is a seam between these
/// corners.
struct FaceVaryingIndices {
  std::span<const int32_t> indices;
  uint32_t value_count = 0;
};

/// Control cage: polygons, creases and boundary rules. The caller owns the arrays; Subdivision
/// reads them in its constructor only.
struct Cage {
  std::string name;  ///< name of the surface in error messages
  Scheme scheme = Scheme::kCatmullClark;
  BoundaryRule boundary = BoundaryRule::kEdgeAndCorner;
  FaceVaryingRule face_varying = FaceVaryingRule::kCornersPlus1;
  /// Whether UsdGeomMesh::triangleSubdivisionRule is "smooth" (Catmull-Clark only)
  bool smooth_triangles = false;
  uint32_t vertex_count = 0;
  std::span<const int32_t> face_sizes, corners;
  std::span<const int32_t> holes;
  std::span<const int32_t> crease_edges;  ///< 2 points per edge
  /// One value per edge; 10 or more means infinitely sharp.
  std::span<const float> crease_sharpness;
  std::span<const int32_t> corner_vertices;  ///< sharp vertices
  std::span<const float> corner_sharpness;
  std::vector<FaceVaryingIndices> channels;
};

/// Validates everything that OpenSubdiv assumes about a cage. Throws Error with a one-line
/// description of the first fault.
void check_cage(const Cage& cage);

/// Throws an Error that states both counts if `found` differs from `needed`. `things`: plural noun
/// for the message, such as "components of a primvar".
void check_count(const char* things, size_t found, size_t needed);

/// Face-varying values without duplicates: a value index for each corner, and an array of the
/// distinct values, of shape (count, width).
struct Welded {
  std::vector<int32_t> indices;
  std::vector<float> values;
};
/// Merges equal values of corners that share a vertex, without a tolerance. `corners` are vertex
/// indices below `vertex_count`; `values` is (corners, width). Throws Error if vertex indices or
/// array sizes are invalid.
Welded weld_corners(std::span<const int32_t> corners, uint32_t vertex_count,
                    std::span<const float> values, uint32_t width);

}  // namespace wavecomb
