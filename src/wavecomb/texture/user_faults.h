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
  /// Puts a copy of `from` where nothing is, and wakes who waits there.
  void fill(const std::byte* at, const std::byte* from, size_t bytes);
  /// Gives memory back. What is read there from then on waits.
  void release(const std::byte* at, size_t bytes);
  /// Lets those go on who waited for a place that was filled before they asked.
  void wake(const std::byte* at, size_t bytes);
  /// Waits until someone reads where nothing is, and puts some such places into `places`; false
  /// once `stop` was called.
  bool wait(std::vector<const std::byte*>& places);
  /// Ends every `wait`, now and later.
  void stop();

 private:
  int faults_ = -1, stop_ = -1;
  std::vector<std::pair<std::byte*, size_t>> maps_;
};

/// Bytes of a page of memory.
size_t page_bytes();

}  // namespace wavecomb
