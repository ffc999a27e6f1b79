// SPDX-License-Identifier: Apache-2.0
/// Bounds of the fields of a volume that a velocity field moves while the shutter is open.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "wavecomb/medium/description/volume.h"
#include "wavecomb/medium/description/wide_map.h"

namespace wavecomb {

/// Bounding cells of a moving field. These cubes cover the space that the field can reach, in units
/// of the field's bricks.
struct MovedCells {
  std::array<double, 3> first{};   ///< lower corner, in bricks of the field
  double edge = 1;                 ///< edge length of a cell, in bricks of the field
  std::array<uint32_t, 3> size{};  ///< number of cells
  std::vector<float> most;         ///< maximum value that a lookup in each cell can return

  /// Maps cells to bricks of the field.
  WideMap to_bricks() const { return {{first[0], first[1], first[2]}, edge}; }
};

/// Bounds of the fields of a volume over the shutter interval. The bounds do not depend on the
/// volume's transform. Immutable.
class VolumeMotion {
 public:
  /// Computes the bounds of a volume that moves (Volume::moves) and has a density grid.
  explicit VolumeMotion(const Volume& volume);

  const MovedCells& density() const { return density_; }
  /// Returns the bounds of the emission field, or of density if there is no emission field.
  const MovedCells& emission() const { return emission_.most.empty() ? density_ : emission_; }
  size_t bytes() const { return 4 * (density_.most.size() + emission_.most.size()); }

 private:
  MovedCells density_, emission_;
};

/// Returns whether the motion bounds of volume `a` are also valid for volume `b`.
bool has_same_motion(const Volume& a, const Volume& b);

/// Maps bricks of a field to the volume's local space.
WideMap bricks_to_object(const VolumeField& field);

}  // namespace wavecomb
