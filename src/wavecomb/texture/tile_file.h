// SPDX-License-Identifier: Apache-2.0
/// Unnamed temporary file.
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <string>

namespace wavecomb {

/// Temporary file without a name. The file is deleted when it is closed, and also when the process
/// ends in any way.
///
/// Contract: all members may be called concurrently.
class TileFile {
 public:
  /// Throws Error if no file can be created in `folder`.
  explicit TileFile(std::string folder);
  ~TileFile();
  TileFile(const TileFile&) = delete;
  TileFile& operator=(const TileFile&) = delete;

  /// Writes `bytes` bytes at `offset`. Throws Error if the disk is full.
  void write(const std::byte* from, size_t bytes, uint64_t offset);
  /// Reads bytes that were written before; returns false on failure.
  [[nodiscard]] bool read(std::byte* to, size_t bytes, uint64_t offset) const;
  /// Frees the disk space of a range that is no longer needed.
  void discard(uint64_t offset, uint64_t bytes);
  /// Offset after the last byte ever written.
  uint64_t bytes() const { return bytes_; }

 private:
  std::string folder_;
  int file_ = -1;
  std::atomic<uint64_t> bytes_ = 0;
};

}  // namespace wavecomb
