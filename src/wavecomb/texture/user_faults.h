// SPDX-License-Identifier: Apache-2.0
/// Demand-filled memory with Linux userfaultfd.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

namespace wavecomb {

/// Address space that is filled on demand. A thread that reads an unfilled page blocks until
/// another thread fills the page. The function wait() returns the addresses of pages to fill.
/// Requires Linux 5.11 or later.
///
/// Contract: all members may be called concurrently; ranges are multiples of pages. The kernel
/// cannot read unfilled pages, so never pass them to a system call.
class UserFaults {
 public:
  /// Returns a short reason why the system does not support demand-filled memory, or "" if the
  /// system supports it.
  static std::string unsupported_reason();

  /// If the system does not support demand-filled memory, throws Error with the reason.
  UserFaults();
  /// Unmaps all memory. No thread may be in wait() or read the memory when the destructor runs.
  ~UserFaults();
  UserFaults(const UserFaults&) = delete;
  UserFaults& operator=(const UserFaults&) = delete;

  /// Maps a new range of read-only address space, which is valid until this object is destroyed.
  /// Throws Error if no address space is left.
  const std::byte* map(size_t bytes);
  /// Copies `from` to an unfilled range and wakes the threads that wait for this range. Returns 0
  /// on success and errno on failure. After a failure, part of the range may be filled.
  [[nodiscard]] int fill(const std::byte* at, const std::byte* from, size_t bytes) noexcept;
  /// Resumes threads that wait for a range that cannot be filled. Unfilled pages read as zero.
  /// Allocates no memory.
  void abandon(const std::byte* at, size_t bytes) noexcept;
  /// Frees the memory of a range; a thread that reads the range blocks again.
  void release(const std::byte* at, size_t bytes) noexcept;
  /// Wakes threads that wait for a range that is already filled.
  void wake(const std::byte* at, size_t bytes) noexcept;
  /// Maximum number of addresses returned by one wait().
  static constexpr size_t kMaxAddresses = 16;
  /// Blocks until a thread reads an unfilled page. Threads wait for certain addresses; writes up to
  /// kMaxAddresses of them to `addresses` and returns their number, or 0 after stop().
  size_t wait(const std::byte** addresses) noexcept;
  /// Ends all current and future wait() calls.
  void stop();

 private:
  int faults_ = -1, stop_ = -1;
  std::vector<std::pair<std::byte*, size_t>> maps_;
};

/// Returns the page size in bytes.
size_t page_bytes();

}  // namespace wavecomb
