// SPDX-License-Identifier: Apache-2.0
/// Storage of 32-bit values as a structure of arrays.
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <memory>
#include <new>

namespace wavecomb {

/// Arrays (columns) of equal length in one allocation, with elements of type float or uint32_t.
/// Each column is aligned to 64 bytes and padded, so that a packet may be read or written at any
/// index below the capacity.
class SoaBlock {
 public:
  /// Number of padding values after the last value of a column.
  static constexpr size_t kPad = 16;

  SoaBlock() = default;
  SoaBlock(size_t columns, size_t capacity)
      // Pad each column by 16 further values, so that columns start in different cache sets.
      : stride_(((capacity + kPad) + 15) / 16 * 16 + 16),
        data_(static_cast<uint32_t*>(std::aligned_alloc(64, columns * stride_ * 4))),
        bytes_(columns * stride_ * 4) {
    if (!data_) throw std::bad_alloc();
    // Zero the memory on the thread that will use it, so that the operating system allocates its
    // pages on this thread's NUMA node.
    for (size_t i = 0; i < columns * stride_; ++i) data_.get()[i] = 0;
  }

  float* floats(size_t column) const {
    return reinterpret_cast<float*>(data_.get() + column * stride_);
  }
  uint32_t* uints(size_t column) const { return data_.get() + column * stride_; }
  size_t bytes() const { return bytes_; }

 private:
  struct Free {
    void operator()(void* p) const { std::free(p); }
  };
  size_t stride_ = 0;
  std::unique_ptr<uint32_t, Free> data_;
  size_t bytes_ = 0;
};

}  // namespace wavecomb
