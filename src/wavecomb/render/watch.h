// SPDX-License-Identifier: Apache-2.0
/// Work on a separate thread, supervised by the calling thread.
#pragma once

#include <atomic>
#include <condition_variable>
#include <cstdint>
#include <functional>
#include <mutex>

namespace wavecomb {

/// Requests that poll() returns to the supervising thread.
enum class Request : uint8_t {
  kContinue,
  kSnapshot,  ///< pause the work to take a snapshot
  kStop,
};

/// Runs work on a separate thread and supervises it.
///
/// Contract: run() once. The supervisor calls poll() and snapshot() on the calling thread.
class Watch {
 public:
  /// `interval_s` is the time between calls of poll() in seconds.
  explicit Watch(double interval_s = 0.1) : interval_s_(interval_s) {}

  /// Runs `work` on a separate thread. Calls `poll` every interval, and `snapshot` with the work
  /// paused if `poll` requested one. An exception from `work`, `poll` or `snapshot` stops the work
  /// and is rethrown by this function.
  void run(const std::function<void()>& work, const std::function<Request()>& poll,
           const std::function<void()>& snapshot);

  /// Asks the work to end soon. Any thread may call this function.
  void stop() { stopped_ = true; }

  /// Returns whether the work should pause or end soon; the work calls this function regularly. Any
  /// thread may call it.
  bool halted() const { return stopped() || halted_.load(std::memory_order_relaxed); }
  /// Whether the work should end.
  bool stopped() const { return stopped_.load(std::memory_order_relaxed); }
  /// Pauses the work until a requested snapshot has been taken. Returns at once if none was
  /// requested.
  void rest();

 private:
  double interval_s_;
  std::atomic<bool> halted_{false}, stopped_{false};
  std::mutex mutex_;
  std::condition_variable changed_;
  bool wanted_ = false, paused_ = false, finished_ = false;
};

}  // namespace wavecomb
