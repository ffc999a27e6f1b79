// SPDX-License-Identifier: Apache-2.0
/// Chunks of values, packed or not, as OpenVDB reads them, with their sizes checked before a byte
/// is written.
///
/// The library's own functions read as many bytes as a file says that there are, and look
/// afterwards whether there was room for them: a broken file overwrites what lies behind. Ours have
/// the same names, and are found first, since the plug-in is what loads the library
/// (cmake/vdb_exports.map lets them be seen).
#include <openvdb/io/Compression.h>

#include <cstdint>
#include <istream>
#include <memory>

#include "packed.h"

namespace {

/// What a packer may add to what it cannot make smaller.
constexpr uint64_t kOverhead = 1024;

/// Reads the next chunk, of `bytes` once it is unpacked; to nowhere if `data` is null.
template <typename Unpack>
void read_chunk(std::istream& is, char* data, size_t bytes, Unpack&& unpack) {
  int64_t size = 0;
  is.read(reinterpret_cast<char*>(&size), sizeof(size));
  const uint64_t length =
      size <= 0 ? uint64_t{0} - static_cast<uint64_t>(size) : static_cast<uint64_t>(size);
  const bool is_plain = size <= 0;
  if (is_plain ? length != bytes : length > 2 * uint64_t{bytes} + kOverhead)
    OPENVDB_THROW(openvdb::IoError, "a chunk of " << bytes << " bytes says that it has " << length);
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
