// SPDX-License-Identifier: Apache-2.0
/// Writing of .vdb files.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

namespace vdb {

/// Box of voxels that all have the same value.
struct FilledBox {
  std::array<int32_t, 3> first;
  std::array<int32_t, 3> last;
  float value = 0.0f;
};

/// Grid that write_file() writes. Voxels are active unless their value is +0, and the background is
/// +0, so that a reader gets the exact bits of all values. The arrays must exist until write_file()
/// returns.
struct WrittenGrid {
  std::string name;
  /// Number of components of a voxel value, 1 or 3.
  uint32_t channels = 1;
  bool is_half = false;
  size_t bricks = 0;
  /// (bricks, 3) multiples of 8.
  const int32_t* origins = nullptr;
  /// (bricks, 8, 8, 8, channels), x slowest.
  const float* values = nullptr;
  /// Rows of the invertible 4 x 4 matrix M that transforms index coordinates to object coordinates
  /// as p' = p M.
  std::array<double, 16> index_to_object{};
  /// Boxes of voxels that are written before the bricks. Where a box and a brick overlap, voxels
  /// with the value +0 in the brick keep the value of the box.
  std::vector<FilledBox> boxes;
  /// Whether nodes in which all voxels have the same value are stored as tiles.
  bool has_tiles = false;
};

/// Writes grids to a .vdb file. Throws std::system_error if the file cannot be written.
void write_file(const std::string& path, const std::vector<WrittenGrid>& grids);

}  // namespace vdb
