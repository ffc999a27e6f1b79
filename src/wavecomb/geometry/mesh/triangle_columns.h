// SPDX-License-Identifier: Apache-2.0
/// Counts how often parallel lines cross the faces of a mesh, to test whether points are inside the
/// mesh.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "wavecomb/core/vec.h"
#include "wavecomb/geometry/mesh/mesh.h"

namespace wavecomb {

/// Number of faces through which a line leaves a mesh minus the number through which it enters: 1
/// for a point inside a closed mesh that faces outwards, and 0 for a point outside.
struct FacesLeft {
  int ahead = 0;   ///< on the half of the line ahead of the point
  int behind = 0;  ///< on the other half, in the opposite direction
};

/// Triangles of a mesh in a 2D grid perpendicular to one direction. The direction is oblique to the
/// axes, so that lines through the middle of a regular mesh do not hit its edges.
class TriangleColumns {
 public:
  /// Builds the grid. `mesh` must outlive it.
  explicit TriangleColumns(const Mesh& mesh);

  /// Counts the faces through which a line through `p` leaves the mesh, in both directions. Adds
  /// the number of tested triangles to `tests`.
  FacesLeft faces_left(const Vec3<float>& p, size_t& tests) const;

 private:
  Vec3<float> vertex(uint32_t i) const;
  uint32_t cell(float at, float lowest, float per_unit) const;

  std::span<const float> positions_;
  std::span<const uint32_t> indices_;
  uint32_t side_ = 1;  ///< number of cells along x and along y
  float low_[2] = {}, high_[2] = {}, per_unit_[2] = {};
  /// Index of each cell's first entry in `triangles_`, followed by the size of `triangles_`.
  std::vector<uint32_t> first_;
  std::vector<uint32_t> triangles_;  ///< triangle indices, cell by cell
};

}  // namespace wavecomb
