// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/scene/parallel.h"

#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

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

}  // namespace wavecomb
