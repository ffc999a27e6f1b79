// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/schedule/shading_queue.h"

namespace wavecomb {

void ShadingQueue::materialize() {
  if (!ordered) return;
  for (uint32_t c = 0; c < kColumns; ++c) {
    const uint32_t* from = block_.uints(c);
    uint32_t* to = moved_.uints(c);
    for (size_t i = 0; i < size; ++i) to[i] = from[sorted_indices[i]];
  }
  const float* from = rows_.floats(0);
  float* to = moved_rows_.floats(0);
  for (size_t i = 0; i < size; ++i)
    std::memcpy(to + i * row_words_, from + sorted_indices[i] * row_words_,
                row_words_ * sizeof(float));
  std::swap(block_, moved_);
  std::swap(rows_, moved_rows_);
  ordered = false;
  moved = true;
}

void ShadingQueue::clear() {
  size = 0;
  ordered = moved = false;
}

}  // namespace wavecomb
