// SPDX-License-Identifier: Apache-2.0
/// Stable radix sort for all scheduling policies and ray orders.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

namespace wavecomb {

/// Least-significant-digit radix sort of 64-bit keys with 8 bits per pass. Digits that are equal in
/// all keys are skipped.
///
/// Contract: owned by one wave; allocates in the constructor only.
class RadixSorter {
 public:
  RadixSorter() = default;
  explicit RadixSorter(size_t capacity)
      : key_(capacity), key_swap_(capacity), index_swap_(capacity) {}

  /// Buffer for the keys to sort.
  uint64_t* keys() { return key_.data(); }

  /// Writes the indices 0 .. n-1 to `order`, sorted by ascending key. Indices with equal keys are
  /// in ascending order. Returns false, and leaves `order` unwritten, if the keys are already
  /// sorted.
  bool sort(size_t n, uint32_t* order);

 private:
  std::vector<uint64_t> key_, key_swap_;
  std::vector<uint32_t> index_swap_;
};

}  // namespace wavecomb
