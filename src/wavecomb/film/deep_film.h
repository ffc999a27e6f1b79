// SPDX-License-Identifier: Apache-2.0
/// A deep picture while it grows: the samples of each pixel by depth (docs/deep.md).
///
/// A camera ray that meets something, or is stopped by a volume, is a sample of its pixel: a depth,
/// and the light that the path brought. Samples whose depths are close are one bin. Bins of a pixel
/// are ranges of depth that do not overlap, in order; a bin holds n of the pixel's N samples and
/// the sum C of their light. With the share s = n / N, and r what the bins before it leave free,
///   r_0 = 1,  r_{i+1} = r_i - s_i,   alpha_i = s_i / r_i,   color_i = C_i / (N r_i)
/// so that one over the other, sum_i color_i prod_{j<i} (1 - alpha_j), they are sum_i C_i / N: the
/// light of all that covers the pixel, and their alpha is its share.
///
/// Memory is bounded: a pixel has at most `most` bins. Where a sample would need one more, the two
/// neighbours become one that together take up the least of their depth.
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <new>
#include <span>
#include <utility>
#include <vector>

#include "wavecomb/core/aov.h"

namespace wavecomb {

/// What of a pixel lies between two depths.
struct DeepBin {
  double r = 0, g = 0, b = 0;  ///< sums of light
  float front = 0, back = 0;   ///< least and greatest depth
  uint32_t count = 0;          ///< samples
  uint32_t in_volume = 0;      ///< of these, stopped by a volume
};

/// Memory that the system has zeroed, which takes none before it is written to: of types that are
/// zero in all their bytes when they are made.
template <typename T>
struct ZeroedMemory {
  using value_type = T;

  T* allocate(size_t n) {
    void* memory = std::calloc(n, sizeof(T));
    if (!memory) throw std::bad_alloc();
    return static_cast<T*>(memory);
  }
  void deallocate(T* memory, size_t /*n*/) { std::free(memory); }
  template <typename U>
  void construct(U* /*place*/) {}
  template <typename U, typename From>
  void construct(U* place, From&& from) {
    ::new (static_cast<void*>(place)) U(std::forward<From>(from));
  }
  bool operator==(const ZeroedMemory&) const = default;
};

/// Deep samples of a picture, row by row of its window.
struct DeepLayer {
  /// Of one sample: R, G, B, A, Z, ZBack. Colours are premultiplied.
  static constexpr size_t kChannels = 6;
  std::vector<uint32_t> counts;  ///< samples of each pixel
  std::vector<float> values;     ///< kChannels of each sample, the nearest first
  bool empty() const { return counts.empty(); }
};

/// The sums behind a deep picture.
///
/// Contract: as Film's: one thread a pixel at a time, a pixel's samples in sample order. Adding
/// allocates nothing.
class DeepFilm {
 public:
  DeepFilm() = default;
  /// Throws std::bad_alloc.
  DeepFilm(size_t pixels, const DeepLimits& limits);

  bool empty() const { return used_.empty(); }
  /// Adds a sample of depth z >= 0 to a pixel.
  void add(size_t pixel, float z, bool in_volume, const float* rgb);
  /// The samples of all pixels; `samples` are those that each pixel got.
  DeepLayer layer(const std::vector<uint32_t>& samples) const;
  /// All that it holds, for checkpoints: how many bins each pixel has, a byte each, then the bins
  /// that are used, pixel by pixel.
  std::vector<std::byte> packed() const;
  /// Makes an empty film that of packed() bytes. Throws Error where they are of another picture.
  void unpack(std::span<const std::byte> bytes);
  /// The most that it can take.
  size_t bytes() const { return used_.size() * (1 + limits_.most * sizeof(DeepBin)); }

 private:
  DeepBin& bin(size_t pixel, uint32_t i) { return bins_[i * used_.size() + pixel]; }
  const DeepBin& bin(size_t pixel, uint32_t i) const { return bins_[i * used_.size() + pixel]; }
  void insert(size_t pixel, uint32_t at, const DeepBin& added);

  DeepLimits limits_;
  std::vector<uint8_t> used_;  ///< bins of each pixel
  /// Bin 0 of all pixels, then bin 1 ...: those that few pixels reach take little memory.
  std::vector<DeepBin, ZeroedMemory<DeepBin>> bins_;
};

}  // namespace wavecomb
