// SPDX-License-Identifier: Apache-2.0
/// What comes before what among tasks, for ThreadSanitizer, which does not see into oneTBB.
#pragma once

#if defined(__SANITIZE_THREAD__)
#include <sanitizer/tsan_interface.h>
#define WAVECOMB_UNSEEN __attribute__((no_sanitize_thread))
#else
#define WAVECOMB_UNSEEN
#endif

namespace wavecomb {

/// One parallel loop: what is before it is known to its tasks, and what they did to whoever is
/// behind it. Of two tasks neither knows of the other. Nothing in other builds.
///
///     const TaskOrder order;
///     tbb::parallel_for(size_t{0}, n, order.around([&](size_t i) { ... }));
///     order.join();
class TaskOrder {
 public:
  TaskOrder() { release(begun_); }
  TaskOrder(const TaskOrder&) = delete;
  TaskOrder& operator=(const TaskOrder&) = delete;

  /// `body` as a task of the loop. Contract: both outlive it.
  template <typename Body>
  auto around(const Body& body) const {
    // What is captured is read before it is known that it was written: unseen.
    return [this, &body](const auto&... arguments) WAVECOMB_UNSEEN {
      const Task task(*this);
      body(arguments...);
    };
  }
  void join() const { acquire(ended_); }

 private:
  struct Task {
    explicit Task(const TaskOrder& order_) : order(order_) { acquire(order.begun_); }
    ~Task() { release(order.ended_); }
    Task(const Task&) = delete;
    Task& operator=(const Task&) = delete;
    const TaskOrder& order;
  };

#if defined(__SANITIZE_THREAD__)
  static void acquire(const char& place) { __tsan_acquire(const_cast<char*>(&place)); }
  static void release(const char& place) { __tsan_release(const_cast<char*>(&place)); }
#else
  static void acquire(const char&) {}
  static void release(const char&) {}
#endif

  char begun_ = 0, ended_ = 0;
};

/// Tasks of one worker come one behind the other; `worker` is what they share.
class WorkerOrder {
 public:
#if defined(__SANITIZE_THREAD__)
  explicit WorkerOrder(void* worker) : worker_(worker) { __tsan_acquire(worker_); }
  ~WorkerOrder() { __tsan_release(worker_); }
  WorkerOrder(const WorkerOrder&) = delete;
  WorkerOrder& operator=(const WorkerOrder&) = delete;

 private:
  void* worker_;
#else
  explicit WorkerOrder(const void*) {}
#endif
};

}  // namespace wavecomb
