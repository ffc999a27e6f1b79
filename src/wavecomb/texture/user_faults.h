// SPDX-License-Identifier: Apache-2.0
/// Memory that is filled where it is read: the kernel's userfaultfd.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

namespace wavecomb {

/// Address space without memory behind it. A thread that reads where nothing is waits, until
/// another one that called `wait` fills the place. Linux only, 5.11 or later.
///
/// Contract: any thread may call any function at any time; ranges are multiples of pages. The
/// kernel cannot reach what is not filled: pass it to no system call.
class UserFaults {
 public:
  /// Why this system has none, in a few words; "" where it has.
  static std::string obstacle();

  /// Throws Error with `obstacle`.
  UserFaults();
  /// Gives all memory back. Nobody may wait or read then.
  ~UserFaults();
  UserFaults(const UserFaults&) = delete;
  UserFaults& operator=(const UserFaults&) = delete;

  /// More address space, to be read only; it stays as long as this does. Throws Error where there
  /// is no more.
  const std::byte* map(size_t bytes);
  /// Puts a copy of `from` where nothing is, and wakes who waits there. Gives 0, or the number of
  /// the error where the system cannot; part of it may be there then.
  [[nodiscard]] int fill(const std::byte* at, const std::byte* from, size_t bytes) noexcept;
  /// Lets those go on who wait for a place that cannot be filled: they read zeros, or what is there
  /// of it. Takes no memory.
  void give_up(const std::byte* at, size_t bytes) noexcept;
  /// Gives memory back. What is read there from then on waits.
  void release(const std::byte* at, size_t bytes) noexcept;
  /// Lets those go on who waited for a place that was filled before they asked.
  void wake(const std::byte* at, size_t bytes) noexcept;
  /// Places that one `wait` gives at most.
  static constexpr size_t kMostPlaces = 16;
  /// Waits until someone reads where nothing is, and puts some such places into `places`, which has
  /// room for kMostPlaces; gives their number, 0 once `stop` was called.
  size_t wait(const std::byte** places) noexcept;
  /// Ends every `wait`, now and later.
  void stop();

 private:
  int faults_ = -1, stop_ = -1;
  std::vector<std::pair<std::byte*, size_t>> maps_;
};

/// Bytes of a page of memory.
size_t page_bytes();

}  // namespace wavecomb
