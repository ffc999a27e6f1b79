// SPDX-License-Identifier: Apache-2.0
/// What bounds the fields of a volume whose velocities move them while the shutter is open.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "wavecomb/scene/volume.h"
#include "wavecomb/scene/wide_map.h"

namespace wavecomb {

/// Cells of a field that moves: cubes of the space that it may come to, by its own bricks.
struct MovedCells {
  std::array<double, 3> first{};   ///< where they begin, in bricks of the field
  double edge = 1;                 ///< of a cell, in bricks of the field
  std::array<uint32_t, 3> size{};  ///< cells
  std::vector<float> most;         ///< by cell: greatest value that a lookup in it can give

  /// From cells to bricks of the field.
  WideMap to_bricks() const { return {{first[0], first[1], first[2]}, edge}; }
};

/// Bounds of a volume's fields over the shutter; the same wherever it is placed. Immutable.
class VolumeMotion {
 public:
  /// Of a volume that moves (Volume::moves) and has a density grid.
  explicit VolumeMotion(const Volume& volume);

  const MovedCells& density() const { return density_; }
  /// Those of density, where there is no such field.
  const MovedCells& glow() const { return glow_.most.empty() ? density_ : glow_; }
  size_t bytes() const { return 4 * (density_.most.size() + glow_.most.size()); }

 private:
  MovedCells density_, glow_;
};

/// Whether the motion of `a` is that of `b`, too.
bool moves_alike(const Volume& a, const Volume& b);

/// Bricks of a field to voxel indices and to the volume's own space.
WideMap bricks_to_object(const VolumeField& field);

}  // namespace wavecomb
