// SPDX-License-Identifier: Apache-2.0
/// Reader of .nvdb files: segments of grids in NanoVDB's memory layout, plain or compressed.
///
/// NanoVDB follows offsets in a file without checks. The reader uses only the memory layouts of
/// NanoVDB's structures, and checks each offset before use.
#pragma once

#include <memory>
#include <string>

#include "files.h"

namespace vdb {

/// Returns whether a file begins with NanoVDB's magic number; false if the file cannot be opened.
bool is_nano_file(const std::string& path);

/// Opens a .nvdb file and reads its table of grids. Reading a grid throws TooLarge also if its
/// unpacked size exceeds `max_bytes`.
std::unique_ptr<GridFile> open_nano_file(const std::string& path);

}  // namespace vdb
