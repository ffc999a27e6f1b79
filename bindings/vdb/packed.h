// SPDX-License-Identifier: Apache-2.0
/// Packed bytes, with all sizes checked before a byte is written.
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>

// By their prototypes: the libraries are OpenVDB's, and their headers need not be installed.
extern "C" {
int blosc_decompress_ctx(const void* from, void* to, size_t size, int threads);
int uncompress(unsigned char* to, unsigned long* size, const unsigned char* from,
               unsigned long from_size);
}

namespace vdb {

/// Unpacks a buffer of Blosc, which begins with 16 bytes that name its sizes; false where it does
/// not give `bytes` bytes.
inline bool unpack_blosc(const unsigned char* packed, uint64_t length, char* to, size_t bytes) {
  constexpr uint64_t kHead = 16;
  uint32_t unpacked_size = 0, packed_size = 0;
  if (length < kHead) return false;
  std::memcpy(&unpacked_size, packed + 4, sizeof(unpacked_size));
  std::memcpy(&packed_size, packed + 12, sizeof(packed_size));
  if (unpacked_size != bytes || packed_size > length) return false;
  return blosc_decompress_ctx(packed, to, bytes, 1) == static_cast<int>(bytes);
}

/// Likewise for zlib.
inline bool unpack_zip(const unsigned char* packed, uint64_t length, char* to, size_t bytes) {
  unsigned long found = bytes;
  return uncompress(reinterpret_cast<unsigned char*>(to), &found, packed, length) == 0 &&
         found == bytes;
}

}  // namespace vdb
