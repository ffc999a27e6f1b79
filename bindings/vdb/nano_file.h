// SPDX-License-Identifier: Apache-2.0
/// A .nvdb file: segments of grids in the memory layout of NanoVDB, plain or packed.
///
/// NanoVDB follows whatever offsets a file holds. Here its structures serve as layouts alone, and
/// each offset is checked before it is followed.
#pragma once

#include <memory>
#include <string>

#include "files.h"

namespace vdb {

/// Whether a file begins as those of NanoVDB do; false if it cannot be opened.
bool is_nano_file(const std::string& path);

/// Opens a .nvdb file and finds its grids. Reading throws TooLarge also if the packed grid takes
/// more than `most_bytes`.
std::unique_ptr<GridFile> open_nano_file(const std::string& path);

}  // namespace vdb
