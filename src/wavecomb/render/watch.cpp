// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/render/watch.h"

#include <chrono>
#include <exception>
#include <thread>

namespace wavecomb {

void Watch::run(const std::function<void()>& work, const std::function<Request()>& poll,
                const std::function<void()>& snapshot) {
  std::exception_ptr failure, thrown;
  std::thread runner([&] {
    std::exception_ptr error;
    try {
      work();
    } catch (...) {
      error = std::current_exception();
    }
    const std::lock_guard lock(mutex_);
    failure = error;
    finished_ = true;
    changed_.notify_all();
  });
  std::unique_lock lock(mutex_);
  while (!finished_) {
    const bool is_called = changed_.wait_for(lock, std::chrono::duration<double>(interval_s_),
                                             [&] { return finished_ || paused_; });
    if (finished_) break;
    if (!is_called && wanted_) continue;  // a pause of the work was already requested
    const bool takes_snapshot = paused_;
    lock.unlock();
    Request request = Request::kContinue;
    try {
      if (takes_snapshot)
        snapshot();
      else if (!thrown)
        request = poll();
    } catch (...) {
      thrown = std::current_exception();
      request = Request::kStop;
    }
    lock.lock();
    if (request == Request::kStop) stop();
    if (takes_snapshot) {
      wanted_ = paused_ = false;
      halted_ = false;
      changed_.notify_all();
    } else if (request == Request::kSnapshot && snapshot) {
      wanted_ = halted_ = true;
    }
  }
  lock.unlock();
  runner.join();
  if (thrown) std::rethrow_exception(thrown);
  if (failure) std::rethrow_exception(failure);
}

void Watch::rest() {
  std::unique_lock lock(mutex_);
  if (!wanted_) return;
  paused_ = true;
  changed_.notify_all();
  changed_.wait(lock, [&] { return !paused_; });
}

}  // namespace wavecomb
