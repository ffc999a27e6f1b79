// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/schedule/radix_sort.h"

#include <array>
#include <cstring>

namespace wavecomb {

bool RadixSorter::sort(size_t n, uint32_t* order) {
  uint64_t* keys = key_.data();
  uint64_t differing = 0;
  bool sorted = true;
  for (size_t i = 1; i < n; ++i) {
    differing |= keys[i] ^ keys[0];
    sorted = sorted && keys[i - 1] <= keys[i];
  }
  if (sorted) return false;

  uint64_t* other_keys = key_swap_.data();
  uint32_t* index = order;
  uint32_t* other_index = index_swap_.data();
  for (size_t i = 0; i < n; ++i) index[i] = static_cast<uint32_t>(i);
  for (int shift = 0; shift < 64; shift += 8) {
    if (((differing >> shift) & 0xff) == 0) continue;
    std::array<uint32_t, 256> start{};
    for (size_t i = 0; i < n; ++i) ++start[(keys[i] >> shift) & 0xff];
    uint32_t sum = 0;
    for (uint32_t& s : start) {
      const uint32_t count = s;
      s = sum;
      sum += count;
    }
    for (size_t i = 0; i < n; ++i) {
      const uint32_t to = start[(keys[i] >> shift) & 0xff]++;
      other_keys[to] = keys[i];
      other_index[to] = index[i];
    }
    std::swap(keys, other_keys);
    std::swap(index, other_index);
  }
  if (index != order) std::memcpy(order, index, n * sizeof(uint32_t));
  return true;
}

}  // namespace wavecomb
