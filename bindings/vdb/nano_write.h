// SPDX-License-Identifier: Apache-2.0
/// Grids as NanoVDB has them, for files.
#pragma once

#include <openvdb/openvdb.h>

#include <string>
#include <vector>

namespace vdb {

/// A grid to be written.
struct NanoDesc {
  /// A FloatGrid or Vec3SGrid.
  openvdb::GridBase::Ptr grid;
  /// Of a number: "32", and of a FloatGrid "4", "8", "16" or "n", in which leaves are quantised.
  std::string bits;
};

/// Whether this build has what writes them.
bool can_write_nano();

/// Writes a file, plain (""), or packed by "zip" or "blosc"; the same grids give the same bytes.
/// Throws std::invalid_argument, std::system_error, std::bad_alloc.
void write_nano(const std::string& path, const std::vector<NanoDesc>& grids,
                const std::string& packed);

}  // namespace vdb
