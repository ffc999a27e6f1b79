// SPDX-License-Identifier: Apache-2.0
/// The polygons that subdivision surfaces are made from, and values on their corners.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

namespace wavecomb {

enum class Scheme : uint8_t { kCatmullClark, kLoop, kBilinear };
/// UsdGeomMesh::interpolateBoundary: none, edgeOnly, edgeAndCorner.
enum class BoundaryRule : uint8_t { kNone, kEdgeOnly, kEdgeAndCorner };
/// UsdGeomMesh::faceVaryingLinearInterpolation: what is kept linear, least first.
enum class FaceVaryingRule : uint8_t {
  kNone,
  kCornersOnly,
  kCornersPlus1,
  kCornersPlus2,
  kBoundaries,
  kAll,
};

/// Face-varying values: an index for each corner of the cage. Corners of one point with one index
/// are joined; others are apart.
struct FaceVaryingIndices {
  std::span<const int32_t> indices;
  uint32_t value_count = 0;
};

/// The polygons that a surface is made from. Arrays are the caller's; the constructor of
/// Subdivision reads them.
struct Cage {
  std::string name;  ///< for messages
  Scheme scheme = Scheme::kCatmullClark;
  BoundaryRule boundary = BoundaryRule::kEdgeAndCorner;
  FaceVaryingRule face_varying = FaceVaryingRule::kCornersPlus1;
  bool smooth_triangles = false;  ///< Catmull-Clark: triangleSubdivisionRule "smooth"
  uint32_t vertex_count = 0;
  std::span<const int32_t> face_sizes, corners;
  std::span<const int32_t> holes;
  std::span<const int32_t> crease_edges;     ///< 2 points for each edge
  std::span<const float> crease_sharpness;   ///< one for each edge; 10 and more: infinite
  std::span<const int32_t> corner_vertices;  ///< sharp points
  std::span<const float> corner_sharpness;
  std::vector<FaceVaryingIndices> channels;
};

/// Throws Error, one line that says what is wrong with the cage: what OpenSubdiv takes for granted.
void check_cage(const Cage& cage);

/// Indices that join the corners of a point where their values (corners, width) are equal, bit for
/// bit, and the values that they address.
struct Welded {
  std::vector<int32_t> indices;
  std::vector<float> values;
};
Welded weld_corners(std::span<const int32_t> corners, uint32_t vertex_count,
                    std::span<const float> values, uint32_t width);

}  // namespace wavecomb
