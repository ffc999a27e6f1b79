// SPDX-License-Identifier: Apache-2.0
/// Functions that describe grids in NanoVDB's memory layout and convert them to bricks, without
/// using OpenVDB.
#pragma once

#include <cstdint>

#include "bricks.h"

namespace vdb {

/// Returns the major version of NanoVDB's memory layout that this build reads, or 0 if Wavecomb was
/// built without NanoVDB.
uint32_t nano_major_version();

/// Returns whether grids of a nanovdb::GridType are supported.
bool is_nano_type_read(uint32_t type);

/// Returns OpenVDB's name of the value type of a nanovdb::GridType, such as "float", "vec3s" or
/// "fp8".
const char* nano_type_word(uint32_t type);

/// Describes the grid in the `size` bytes at `bytes`, an address that must be a multiple of 32.
/// `type` is the grid type from the file's table. Reads nothing outside these bytes. Throws
/// `BrokenFile` for invalid data.
GridFacts nano_facts(const unsigned char* bytes, uint64_t size, uint32_t type);

/// Converts a grid to bricks. Throws `TooLarge` if the bricks exceed options.max_bytes, and
/// `std::bad_alloc` if the allocation fails.
Bricks nano_bricks(const unsigned char* bytes, uint64_t size, uint32_t type,
                   const BrickOptions& options);

}  // namespace vdb
