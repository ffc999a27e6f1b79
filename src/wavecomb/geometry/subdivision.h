// SPDX-License-Identifier: Apache-2.0
/// Subdivision surfaces: topology refined by OpenSubdiv, values on it.
#pragma once

#include <cstdint>
#include <memory>
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

/// The faces of the last level, without ownership of the refiner: `size` corners each.
struct RefinedFaces {
  uint32_t size = 4;                   ///< 3 for Loop
  uint32_t vertex_count = 0;           ///< points of the level, those of holes too
  std::vector<uint32_t> corners;       ///< point of each corner
  std::vector<uint32_t> base;          ///< face of the cage that each face came from
  std::vector<uint32_t> first_values;  ///< of channel 0 at each corner; empty without channels

  size_t count() const { return base.size(); }
};

/// A cage refined uniformly. Values are computed on the limit surface itself.
///
/// Contract: immutable; one thread each, any number at once.
class Subdivision {
 public:
  static constexpr uint32_t kMaxLevel = 10;

  /// `level`: 1 to kMaxLevel. Throws Error, one line that says what is wrong with the cage.
  Subdivision(const Cage& cage, uint32_t level);
  ~Subdivision();
  Subdivision(Subdivision&&) noexcept;

  /// Edges or points where more than two faces or two fans of faces meet: they are kept sharp.
  bool is_manifold() const;
  uint32_t vertex_count() const;

  /// The faces that are drawn: not holes, nor those without a limit (BoundaryRule::kNone).
  RefinedFaces faces() const;
  /// Index into a channel's refined values of each corner of faces().
  std::vector<uint32_t> face_varying_corners(uint32_t channel) const;

  /// For each corner of `faces`, which normal it has: the point's number where the surface is
  /// smooth there, and numbers from vertex_count() on where sharp edges cut it into sectors.
  /// `count` becomes the number of normals.
  std::vector<uint32_t> normal_sectors(const RefinedFaces& faces, uint32_t& count) const;

  /// Values (vertex_count, width), of the cage's points, at the limit. `tangents`, if given, gets
  /// two derivatives of each value, (vertex_count, 2, width); width 3 only.
  /// Widths are 1 to 4.
  std::vector<float> vertex(std::span<const float> values, uint32_t width,
                            std::vector<float>* tangents = nullptr) const;
  /// The same, linear within each face of the cage.
  std::vector<float> varying(std::span<const float> values, uint32_t width) const;
  /// Values of a channel at the limit, addressed by face_varying_corners(channel).
  std::vector<float> face_varying(uint32_t channel, std::span<const float> values,
                                  uint32_t width) const;

 private:
  struct Refiner;
  std::unique_ptr<Refiner> refiner_;
};

/// Indices that join the corners of a point where their values (corners, width) are equal, bit for
/// bit, and the values that they address.
struct Welded {
  std::vector<int32_t> indices;
  std::vector<float> values;
};
Welded weld_corners(std::span<const int32_t> corners, uint32_t vertex_count,
                    std::span<const float> values, uint32_t width);

}  // namespace wavecomb
