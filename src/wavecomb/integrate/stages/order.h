// SPDX-License-Identifier: Apache-2.0
/// Stage 3b: the policy gives the shading queue its order.
#pragma once

#include "wavecomb/integrate/wave.h"

namespace wavecomb {

/// Keys -> stable sort -> sorted_indices -> materialize, each in its own phase.
inline void order_records(Wave& wave, const WaveContext& context, uint32_t depth) {
  ShadingQueue& queue = wave.shading;
  if (queue.size < 2) return;
  wave.clock.enter(Phase::kKeys);
  const ShadingQueueView view{{queue.uints(ShadingQueue::kProgram), queue.size},
                              {queue.uints(ShadingQueue::kMaterial), queue.size},
                              depth};
  const bool wanted = context.policy->order(view, *context.costs, {wave.sorter.keys(), queue.size});
  if (!wanted) return;
  wave.clock.enter(Phase::kSort);
  queue.ordered = wave.sorter.sort(queue.size, queue.sorted_indices);
  if (!queue.ordered || context.settings->materialize != Materialize::kOn) return;
  wave.clock.enter(Phase::kMaterialize);
  queue.materialize();
}

}  // namespace wavecomb
