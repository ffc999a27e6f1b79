// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/schedule/shading_queue.h"

namespace wavecomb {

void ShadingQueue::materialize() {
  if (!ordered) return;
  for (uint32_t c = 0; c < kColumns; ++c) {
    const uint32_t* from = columns_[c];
    uint32_t* to = moved_.uints(c);
    for (size_t i = 0; i < size; ++i) to[i] = from[sorted_indices[i]];
    columns_[c] = to;
  }
  std::swap(block_, moved_);
  ordered = false;
}

void ShadingQueue::clear() {
  size = 0;
  ordered = false;
}

}  // namespace wavecomb
