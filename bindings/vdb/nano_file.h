// SPDX-License-Identifier: Apache-2.0
/// Reader of .nvdb files. A file consists of segments of grids in NanoVDB's memory layout,
/// optionally compressed.
///
/// NanoVDB follows offsets in a file without checks. Wavecomb's reader uses only NanoVDB's
/// definitions of data structures, and checks each offset before use.
#pragma once

#include <memory>
#include <string>

#include "files.h"

namespace vdb {

/// Returns whether a file begins with NanoVDB's magic number; false if the file cannot be opened.
bool is_nano_file(const std::string& path);

/// Opens a .nvdb file and reads its table of grids. `GridFile::read` of this file also throws
/// `TooLarge` if a grid's unpacked size exceeds `max_bytes`.
std::unique_ptr<GridFile> open_nano_file(const std::string& path);

}  // namespace vdb
