// SPDX-License-Identifier: Apache-2.0
/// Description of a grid in a file, and errors of reading a grid. This header does not depend on
/// OpenVDB or NanoVDB.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

namespace vdb {

/// Exception for a file that is not a volume file, is truncated, or has invalid contents. The
/// message is one line that says what is wrong.
struct BrokenFile : std::runtime_error {
  using std::runtime_error::runtime_error;
};

/// Exception for reading a grid that needs more memory than allowed. The message states in one line
/// how much memory is needed.
struct TooLarge : std::runtime_error {
  using std::runtime_error::runtime_error;
};

/// Entry of a file's table of grids.
struct Head {
  std::string name;
  /// Position of the grid among the grids of the same name, in the order of the file.
  uint32_t index = 0;
  /// OpenVDB's name of the grid's type, such as "Tree_float_5_4_3", or "Tree_fp8_5_4_3" for a
  /// quantised grid.
  std::string type;
  bool is_half = false;
};

/// First and last index of an axis-aligned box of voxels, both inclusive.
struct IndexBox {
  std::array<int32_t, 3> first{}, last{};

  void extend(const std::array<int32_t, 3>& from, const std::array<int32_t, 3>& to) {
    for (size_t axis = 0; axis < 3; ++axis) {
      if (from[axis] < first[axis]) first[axis] = from[axis];
      if (to[axis] > last[axis]) last[axis] = to[axis];
    }
  }
};

/// Properties of a grid that are known without reading voxel values.
struct GridFacts {
  /// Whether bricks can be made from a grid of this type.
  bool is_read = false;
  /// Grid class: "fog volume", "level set", "staggered" or "unknown".
  std::string kind;
  /// Row-major 4 x 4 matrix M that transforms index coordinates to object coordinates as p' = p M.
  /// Empty if the transform is not affine.
  std::optional<std::array<double, 16>> index_to_object;
  /// Background value of the grid, with 1 or 3 components. Empty if the grid's type is not
  /// supported.
  std::vector<float> background;
  /// Number of active voxels.
  uint64_t voxels = 0;
  /// Bounds of the active voxels. Empty if the grid has no active voxels.
  std::optional<IndexBox> box;
  std::vector<std::pair<std::string, std::string>> metadata;
};

}  // namespace vdb
