// SPDX-License-Identifier: Apache-2.0
/// Common interface of .vdb and .nvdb files that are open for reading.
#pragma once

#include <cstddef>
#include <memory>
#include <string>

#include "bricks.h"
#include "grid.h"

namespace vdb {

/// Open .vdb or .nvdb file, which contains grids. Functions throw BrokenFile, std::system_error and
/// std::bad_alloc.
class GridFile {
 public:
  GridFile() = default;
  GridFile(const GridFile&) = delete;
  GridFile& operator=(const GridFile&) = delete;
  virtual ~GridFile() = default;

  virtual size_t size() const = 0;
  virtual Head head(size_t number) const = 0;
  /// Describes a grid. Returns false if OpenVDB or NanoVDB does not know the grid's type.
  virtual bool describe(size_t number, GridFacts& facts) = 0;
  /// Reads a grid's values. Throws BrokenFile if the grid's type is not supported, and TooLarge if
  /// the bricks exceed options.max_bytes.
  virtual Bricks read(size_t number, const BrickOptions& options, GridFacts& facts) = 0;
};

/// Opens a file. Detects the format from the file's first bytes, not from its name.
std::unique_ptr<GridFile> open_file(const std::string& path);

/// Opens a .vdb file (archive.cpp).
std::unique_ptr<GridFile> open_archive(const std::string& path);

/// Registers OpenVDB's grid types. Must be called once before files are opened.
void initialize_openvdb();

/// Returns the version of OpenVDB, such as "10.0.1".
const char* openvdb_version();

}  // namespace vdb
