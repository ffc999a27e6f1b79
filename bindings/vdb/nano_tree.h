// SPDX-License-Identifier: Apache-2.0
/// A grid in NanoVDB's layout as one of OpenVDB.
#pragma once

#include <openvdb/openvdb.h>

#include <cstdint>

namespace vdb {

/// Whether this build knows the layout, and the version of it; 0 where it does not.
uint32_t nano_major_version();

/// Whether grids of a nanovdb::GridType are read.
bool is_nano_type_read(uint32_t type);

/// Word for a nanovdb::GridType as OpenVDB has them ("float", "vec3s"), or "fp8".
const char* nano_type_word(uint32_t type);

/// The grid in `size` bytes that begin at a multiple of 32; `type` is what the file's table says.
/// Nothing outside of these bytes is read. Throws BrokenFile, TooLarge, std::bad_alloc.
openvdb::GridBase::Ptr read_nano(const unsigned char* bytes, uint64_t size, uint32_t type,
                                 uint64_t most_bytes);

}  // namespace vdb
