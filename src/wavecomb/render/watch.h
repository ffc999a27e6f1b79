// SPDX-License-Identifier: Apache-2.0
/// Long work on a thread of its own, watched by the thread that asked for it.
#pragma once

#include <atomic>
#include <condition_variable>
#include <cstdint>
#include <functional>
#include <mutex>

namespace wavecomb {

/// What the watcher may answer.
enum class Request : uint8_t {
  kGoOn,
  kSnapshot,  ///< let the work stand still for a moment, so that it can be looked at
  kStop,
};

/// Contract: run() once. look() and snapshot() are called on the thread that called run().
class Watch {
 public:
  /// `interval_s`: seconds between looks.
  explicit Watch(double interval_s = 0.1) : interval_s_(interval_s) {}

  /// Runs `work` on a thread of its own; calls `look` every interval, and `snapshot` while
  /// the work stands still, where `look` asked for that. What any of them throws stops the work and
  /// comes out of here.
  void run(const std::function<void()>& work, const std::function<Request()>& look,
           const std::function<void()>& snapshot);

  /// The work is to end soon. May be called by any thread.
  void stop() { stopped_ = true; }

  // For the work:
  /// Whether it is to come to rest soon. May be asked by any thread.
  bool halted() const { return stopped() || halted_.load(std::memory_order_relaxed); }
  /// Whether it is to end.
  bool stopped() const { return stopped_.load(std::memory_order_relaxed); }
  /// It stands still now: returns once a snapshot, if one is wanted, has been taken.
  void rest();

 private:
  double interval_s_;
  std::atomic<bool> halted_{false}, stopped_{false};
  std::mutex mutex_;
  std::condition_variable changed_;
  bool wanted_ = false, resting_ = false, finished_ = false;
};

}  // namespace wavecomb
