// SPDX-License-Identifier: Apache-2.0
/// A grid in NanoVDB's memory layout: description and bricks, without OpenVDB.
#pragma once

#include <cstdint>

#include "bricks.h"

namespace vdb {

/// Major version of the layout that this build reads; 0 if it was built without NanoVDB.
uint32_t nano_major_version();

/// Whether grids of a nanovdb::GridType are read.
bool is_nano_type_read(uint32_t type);

/// OpenVDB's word for a nanovdb::GridType ("float", "vec3s"), or "fp8".
const char* nano_type_word(uint32_t type);

/// Functions below take `size` bytes that begin at a multiple of 32, and the type in the table of
/// the file. They read nothing outside of these bytes, and throw BrokenFile.
GridFacts nano_facts(const unsigned char* bytes, uint64_t size, uint32_t type);

/// Makes bricks. Throws TooLarge, std::bad_alloc.
Bricks nano_bricks(const unsigned char* bytes, uint64_t size, uint32_t type,
                   const BrickOptions& options);

}  // namespace vdb
