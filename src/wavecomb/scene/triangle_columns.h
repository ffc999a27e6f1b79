// SPDX-License-Identifier: Apache-2.0
/// Counts of the faces of a mesh on lines along one direction.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "wavecomb/scene/mesh.h"

namespace wavecomb {

/// The triangles of a mesh in a grid across one direction, which is oblique to the axes so that
/// lines through the middle of a regular mesh do not meet its edges.
class TriangleColumns {
 public:
  /// `mesh` must live as long.
  explicit TriangleColumns(const Mesh& mesh);

  /// Faces that a line from `p` leaves less those that it enters: of a closed mesh that faces
  /// outwards 1 for a point inside, and else 0. Adds the triangles that it tests to `tests`.
  int faces_left(const Vec3<float>& p, size_t& tests) const;

 private:
  Vec3<float> vertex(uint32_t i) const;
  uint32_t cell(float at, float lowest, float per_unit) const;

  std::span<const float> positions_;
  std::span<const uint32_t> indices_;
  uint32_t side_ = 1;  ///< cells along x and along y
  float low_[2] = {}, high_[2] = {}, per_unit_[2] = {};
  std::vector<uint32_t> first_;      ///< by cell, of `triangles_`; and their number
  std::vector<uint32_t> triangles_;  ///< cell by cell
};

}  // namespace wavecomb
