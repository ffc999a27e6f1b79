// SPDX-License-Identifier: Apache-2.0
/// Decompression of zlib and Blosc data. The functions check all sizes before they write.
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>

// Declarations of functions of Blosc and zlib. OpenVDB links these libraries, but their headers may
// not be installed.
extern "C" {
int blosc_decompress_ctx(const void* from, void* to, size_t size, int threads);
int uncompress(unsigned char* to, unsigned long* size, const unsigned char* from,
               unsigned long from_size);
}

namespace vdb {

/// Unpacks a Blosc buffer, whose 16-byte header contains its sizes. Returns false unless the
/// unpacked size is `bytes` bytes.
inline bool unpack_blosc(const unsigned char* packed, uint64_t length, char* to, size_t bytes) {
  constexpr uint64_t kHead = 16;
  uint32_t unpacked_size = 0, packed_size = 0;
  if (length < kHead) return false;
  std::memcpy(&unpacked_size, packed + 4, sizeof(unpacked_size));
  std::memcpy(&packed_size, packed + 12, sizeof(packed_size));
  if (unpacked_size != bytes || packed_size > length) return false;
  return blosc_decompress_ctx(packed, to, bytes, 1) == static_cast<int>(bytes);
}

/// Unpacks zlib data. Returns false unless the unpacked size is `bytes` bytes.
inline bool unpack_zip(const unsigned char* packed, uint64_t length, char* to, size_t bytes) {
  unsigned long found = bytes;
  return uncompress(reinterpret_cast<unsigned char*>(to), &found, packed, length) == 0 &&
         found == bytes;
}

}  // namespace vdb
