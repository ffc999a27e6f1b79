// SPDX-License-Identifier: Apache-2.0
/// Deep image under construction: the samples of each pixel binned by depth (docs/deep.md).
///
/// A camera ray that hits a surface or scatters in a volume gives its pixel one sample: a depth and
/// the radiance of its path. Samples of similar depth share a bin. The bins of a pixel are disjoint
/// depth ranges in ascending order; a bin stores the number n of its samples, of the pixel's N, and
/// the sum C of their radiance. With the coverage s = n / N, and r the coverage that the bins in
/// front leave free,
///   r_0 = 1,  r_{i+1} = r_i - s_i,   alpha_i = s_i / r_i,   color_i = C_i / (N r_i).
/// Compositing the bins with "over", sum_i color_i prod_{j<i} (1 - alpha_j), then gives sum_i C_i /
/// N, the flat colour of everything that covers the pixel; the composited alpha is the covered
/// fraction.
///
/// Memory is bounded by `most` bins per pixel. If a sample would exceed this limit, the two
/// neighbouring bins whose joint depth range is smallest relative to its depth are merged.
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

/// Samples of a pixel within one depth range.
struct DeepBin {
  double r = 0, g = 0, b = 0;  ///< sum of radiance
  float front = 0, back = 0;   ///< smallest and largest depth of the bin's samples
  uint32_t count = 0;          ///< number of samples
  uint32_t in_volume = 0;      ///< number of samples that scattered in a volume
};

/// Allocator of zeroed memory that uses calloc, so that untouched pages take no physical memory.
/// Suitable only for types whose default value is all zero bytes.
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
  void construct(U* target, From&& from) {
    ::new (static_cast<void*>(target)) U(std::forward<From>(from));
  }
  bool operator==(const ZeroedMemory&) const = default;
};

/// Deep samples of an image, row by row of its window.
struct DeepLayer {
  /// Channels of a sample: R, G, B, A, Z, ZBack. Colours are premultiplied.
  static constexpr size_t kChannels = 6;
  std::vector<uint32_t> counts;  ///< number of samples of each pixel
  /// KChannels values per sample; the samples of a pixel are in order of increasing depth.
  std::vector<float> values;
  bool empty() const { return counts.empty(); }
};

/// Depth bins of all pixels of a deep image.
///
/// Contract: at most one thread writes to a pixel at a time and adds its samples in sample order.
/// Adding allocates nothing.
class DeepFilm {
 public:
  DeepFilm() = default;
  /// Throws std::bad_alloc if memory for `limits.most` bins per pixel is not available.
  DeepFilm(size_t pixels, const DeepLimits& limits);

  bool empty() const { return used_.empty(); }
  /// Adds a sample of depth z >= 0. `rgb` is the radiance of the path. `in_volume` is true if the
  /// camera ray scattered in a volume.
  void add(size_t pixel, float z, bool in_volume, const float* rgb);
  /// Returns the deep samples of all pixels. `samples`: sample count of each pixel.
  DeepLayer layer(const std::vector<uint32_t>& samples) const;
  /// Returns the state of the deep image for checkpoints: one byte per pixel with its number of
  /// bins, then the bins in use, pixel by pixel.
  std::vector<std::byte> packed() const;
  /// Restores the state from packed() bytes. Throws Error if the bytes do not fit this image.
  void unpack(std::span<const std::byte> bytes);
  /// Upper bound of the memory use in bytes.
  size_t bytes() const { return used_.size() * (1 + limits_.most * sizeof(DeepBin)); }

 private:
  DeepBin& bin(size_t pixel, uint32_t i) { return bins_[i * used_.size() + pixel]; }
  const DeepBin& bin(size_t pixel, uint32_t i) const { return bins_[i * used_.size() + pixel]; }
  void insert(size_t pixel, uint32_t at, const DeepBin& added);

  DeepLimits limits_;
  std::vector<uint8_t> used_;  ///< number of bins in use for each pixel
  /// Bin 0 of all pixels, then bin 1 of all pixels, and so on, so that the memory of bins that no
  /// pixel uses stays unmapped.
  std::vector<DeepBin, ZeroedMemory<DeepBin>> bins_;
};

}  // namespace wavecomb
