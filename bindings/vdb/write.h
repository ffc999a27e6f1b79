// SPDX-License-Identifier: Apache-2.0
/// Grids of bricks as OpenVDB has them, for files.
#pragma once

#include <openvdb/openvdb.h>

#include <array>
#include <cstdint>
#include <string>
#include <vector>

namespace vdb {

/// Voxels from the first to the last index that have one value.
struct FilledBox {
  std::array<int32_t, 3> first{}, last{};
  float value = 0;
};

/// A grid to be written: bricks as `Bricks` has them, always of floats.
struct GridDesc {
  std::string name;
  size_t count = 0;
  uint32_t channels = 1;
  const int32_t* origins = nullptr;
  const float* values = nullptr;
  /// Filled before bricks are written, with tiles where these fit.
  std::vector<FilledBox> boxes;
  /// Row vectors: p' = p M.
  std::array<double, 16> index_to_object{};
  /// Values are kept in 16 bits.
  bool is_half = false;
  /// Bricks of one value become tiles, and these larger ones.
  bool makes_tiles = false;
};

/// The grid; what is not +0 is active, so that every bit comes back. Throws std::invalid_argument.
openvdb::GridBase::Ptr make_grid(const GridDesc& desc);

}  // namespace vdb
