// SPDX-License-Identifier: Apache-2.0
/// One stable sort for every policy and ray order.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

namespace wavecomb {

/// Least-significant-digit radix sort of 64-bit keys, 8 bits a pass; digits that are equal in all
/// keys cost one look and no pass.
///
/// Contract: owned by one wave; allocates in the constructor only.
class RadixSorter {
 public:
  RadixSorter() = default;
  explicit RadixSorter(size_t capacity)
      : key_(capacity), key_swap_(capacity), index_swap_(capacity) {}

  /// Where a policy writes its keys.
  uint64_t* keys() { return key_.data(); }

  /// Writes to `order` the indices 0 .. n-1 by ascending key, equal keys in ascending index.
  /// Returns false when the keys were in order already, and then `order` is not written.
  bool sort(size_t n, uint32_t* order);

 private:
  std::vector<uint64_t> key_, key_swap_;
  std::vector<uint32_t> index_swap_;
};

}  // namespace wavecomb
