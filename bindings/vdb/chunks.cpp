// SPDX-License-Identifier: Apache-2.0
/// Functions that decompress the chunks of OpenVDB files and check all sizes before they write.
///
/// OpenVDB's functions read as many bytes as the file claims and check afterwards whether the
/// buffer was large enough, so a broken file overwrites memory. This file defines functions of the
/// same names. cmake/vdb_exports.map exports them, so that the OpenVDB library calls these
/// functions and not its unchecked ones.
#include <openvdb/io/Compression.h>

#include <cstdint>
#include <istream>
#include <memory>

#include "packed.h"

namespace {

/// Maximum number of bytes by which a chunk of incompressible data may exceed its unpacked size.
constexpr uint64_t kOverhead = 1024;

/// Reads the next chunk of the stream and unpacks it to `bytes` bytes at `data`. Skips the chunk if
/// `data` is null.
template <typename Unpack>
void read_chunk(std::istream& is, char* data, size_t bytes, Unpack&& unpack) {
  int64_t size = 0;
  is.read(reinterpret_cast<char*>(&size), sizeof(size));
  const uint64_t length =
      size <= 0 ? uint64_t{0} - static_cast<uint64_t>(size) : static_cast<uint64_t>(size);
  const bool is_plain = size <= 0;
  if (is_plain ? length != bytes : length > 2 * uint64_t{bytes} + kOverhead)
    OPENVDB_THROW(openvdb::IoError, "a chunk of " << bytes << " bytes claims to have " << length);
  if (data == nullptr) {
    is.seekg(static_cast<std::streamoff>(length), std::ios_base::cur);
  } else if (is_plain) {
    is.read(data, static_cast<std::streamsize>(bytes));
  } else {
    const auto packed = std::make_unique_for_overwrite<unsigned char[]>(length);
    is.read(reinterpret_cast<char*>(packed.get()), static_cast<std::streamsize>(length));
    if (!unpack(packed.get(), length))
      OPENVDB_THROW(openvdb::IoError, "a chunk of " << bytes << " bytes cannot be unpacked");
  }
}

}  // namespace

namespace openvdb {
OPENVDB_USE_VERSION_NAMESPACE
namespace OPENVDB_VERSION_NAME {
namespace io {

void bloscFromStream(std::istream& is, char* data, size_t bytes) {
  read_chunk(is, data, bytes, [&](const unsigned char* packed, uint64_t length) {
    return vdb::unpack_blosc(packed, length, data, bytes);
  });
}

void unzipFromStream(std::istream& is, char* data, size_t bytes) {
  read_chunk(is, data, bytes, [&](const unsigned char* packed, uint64_t length) {
    return vdb::unpack_zip(packed, length, data, bytes);
  });
}

}  // namespace io
}  // namespace OPENVDB_VERSION_NAME
}  // namespace openvdb
