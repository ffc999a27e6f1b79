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

/// Grid to be written. Voxels other than +0 are active, and the background is +0, so that all bits
/// are preserved. Contract: the arrays outlive the call of write_file().
struct WrittenGrid {
  std::string name;
  /// Components of a value: 1 or 3.
  uint32_t channels = 1;
  bool is_half = false;
  size_t bricks = 0;
  /// (bricks, 3) multiples of 8.
  const int32_t* origins = nullptr;
  /// (bricks, 8, 8, 8, channels), x slowest.
  const float* values = nullptr;
  /// Rows of p' = p M, which has an inverse.
  std::array<double, 16> index_to_object{};
  /// Boxes are written before the bricks. Brick voxels of value +0 leave the voxels of a box
  /// unchanged.
  std::vector<FilledBox> boxes;
  /// Whether nodes in which all voxels have the same value are stored as tiles.
  bool has_tiles = false;
};

/// Writes a file. Throws std::system_error.
void write_file(const std::string& path, const std::vector<WrittenGrid>& grids);

}  // namespace vdb
