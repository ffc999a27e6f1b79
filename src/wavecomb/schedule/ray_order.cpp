// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/schedule/ray_order.h"

#include <array>

namespace wavecomb {

void sort_by_direction(const uint32_t* key, const uint32_t* slot, size_t n, uint32_t* sorted) {
  std::array<uint32_t, kDirectionKeys> rank{};
  for (size_t i = 0; i < n; ++i) ++rank[key[i]];
  uint32_t sum = 0;
  for (uint32_t& p : rank) {
    const uint32_t count = p;
    p = sum;
    sum += count;
  }
  for (size_t i = 0; i < n; ++i) sorted[rank[key[i]]++] = slot[i];
}

}  // namespace wavecomb
