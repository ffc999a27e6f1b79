// SPDX-License-Identifier: Apache-2.0
/// A temporary file that has no name.
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <string>

namespace wavecomb {

/// Goes when it is closed, or when the process ends in any way.
///
/// Contract: any thread may read and write at any time.
class TileFile {
 public:
  /// Throws Error where none can be made in `folder`.
  explicit TileFile(std::string folder);
  ~TileFile();
  TileFile(const TileFile&) = delete;
  TileFile& operator=(const TileFile&) = delete;

  /// Writes `bytes` at `offset`. Throws Error where there is no room for them.
  void write(const std::byte* from, size_t bytes, uint64_t offset);
  /// Reads what was written; false where that fails.
  [[nodiscard]] bool read(std::byte* to, size_t bytes, uint64_t offset) const;
  /// Says that a part is not needed any more.
  void discard(uint64_t offset, uint64_t bytes);
  /// Up to the last byte that was ever written.
  uint64_t bytes() const { return bytes_; }

 private:
  std::string folder_;
  int file_ = -1;
  std::atomic<uint64_t> bytes_ = 0;
};

}  // namespace wavecomb
