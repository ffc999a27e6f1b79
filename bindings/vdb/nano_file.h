// SPDX-License-Identifier: Apache-2.0
/// A .nvdb file: segments of grids in the memory layout of NanoVDB, plain or packed.
///
/// NanoVDB follows whatever offsets a file holds. Here its structures are layouts alone, and each
/// offset is checked before it is followed.
#pragma once

#include <openvdb/openvdb.h>

#include <cstdint>
#include <fstream>
#include <string>
#include <vector>

namespace vdb {

/// Where a grid is in a file.
struct NanoEntry {
  std::string name;
  /// Among the grids of its name, in the file's order.
  uint32_t index = 0;
  /// nanovdb::GridType.
  uint32_t type = 0;
  /// 0: plain, 1: zlib, 2: Blosc.
  uint16_t codec = 0;
  /// Bytes of it in memory, and in the file from `offset`.
  uint64_t size = 0, file_size = 0, offset = 0;
};

/// A file that is open.
class NanoFile {
 public:
  /// Whether a file begins as those of NanoVDB do; false where it cannot be opened.
  static bool is_one(const std::string& path);

  /// Opens a file and finds its grids. Throws BrokenFile, std::system_error, std::bad_alloc.
  explicit NanoFile(const std::string& path);

  const std::vector<NanoEntry>& entries() const { return entries_; }

  /// What OpenVDB would call the type of a grid, with the bits of those that are quantised:
  /// "Tree_float_5_4_3", "Tree_fp8_5_4_3".
  static std::string type_name(const NanoEntry& entry);

  /// Reads a grid as one of OpenVDB; null where it is of a type that is not read. Throws TooLarge
  /// where the file's bytes or the bricks take more than `most_bytes`, and as the constructor.
  openvdb::GridBase::Ptr read(const NanoEntry& entry, uint64_t most_bytes);

 private:
  template <typename T>
  T take();
  void find_grids(uint64_t file_bytes);
  void unpack(const NanoEntry& entry, char* to);

  std::ifstream stream_;
  std::vector<NanoEntry> entries_;
};

}  // namespace vdb
