// SPDX-License-Identifier: Apache-2.0
/// Annotations that inform ThreadSanitizer about the order of tasks. ThreadSanitizer cannot derive
/// this order, since the oneTBB library is not instrumented.
#pragma once

#if defined(__SANITIZE_THREAD__)
#include <sanitizer/tsan_interface.h>
#define WAVECOMB_NO_TSAN __attribute__((no_sanitize_thread))
#else
#define WAVECOMB_NO_TSAN
#endif

namespace wavecomb {

/// Annotations of a parallel loop. They state that the code before the loop runs before the loop's
/// tasks, and that the tasks run before the call of join() returns. They do not order the tasks of
/// the loop among themselves. TaskOrder does nothing in builds without ThreadSanitizer.
///
///     const TaskOrder order;
///     tbb::parallel_for(size_t{0}, n, order.around([&](size_t i) { ... }));
///     order.join();
class TaskOrder {
 public:
  TaskOrder() { release(begun_); }
  TaskOrder(const TaskOrder&) = delete;
  TaskOrder& operator=(const TaskOrder&) = delete;

  /// Wraps `body`, the loop's body, as an annotated task.
  ///
  /// Contract: this object and `body` must exist until the task ends.
  template <typename Body>
  auto around(const Body& body) const {
    // ThreadSanitizer must not instrument this function, since the captures are read before the
    // annotation takes effect.
    return [this, &body](const auto&... arguments) WAVECOMB_NO_TSAN {
      const Task task(*this);
      body(arguments...);
    };
  }
  /// Ends the annotated region; call it after the parallel loop.
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
  static void acquire(const char& address) { __tsan_acquire(const_cast<char*>(&address)); }
  static void release(const char& address) { __tsan_release(const_cast<char*>(&address)); }
#else
  static void acquire(const char&) {}
  static void release(const char&) {}
#endif

  char begun_ = 0, ended_ = 0;
};

/// Annotation of a worker's tasks, which run one after another. The address `worker` identifies the
/// worker.
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
