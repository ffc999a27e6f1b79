// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/scene/parallel.h"

#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

#include <algorithm>

#include "wavecomb/core/task_order.h"

namespace wavecomb {

void with_threads(uint32_t threads, const std::function<void()>& work) {
  tbb::task_arena arena(threads == 0 ? tbb::task_arena::automatic : static_cast<int>(threads));
  const TaskOrder order;
  arena.execute(order.around(work));
  order.join();
}

void parallel_for(size_t n, const std::function<void(size_t)>& body) {
  const TaskOrder order;
  tbb::parallel_for(size_t{0}, n, order.around(body));
  order.join();
}

void parallel_bands(size_t n, size_t band, const std::function<void(size_t, size_t)>& body) {
  if (n <= band) {
    if (n > 0) body(0, n);
    return;
  }
  tbb::this_task_arena::isolate([&] {
    parallel_for((n + band - 1) / band,
                 [&](size_t i) { body(i * band, std::min(n, (i + 1) * band)); });
  });
}

uint32_t loop_threads() {
  return static_cast<uint32_t>(std::max(1, tbb::this_task_arena::max_concurrency()));
}

}  // namespace wavecomb
