// SPDX-License-Identifier: Apache-2.0
/// Sums of a deep image during rendering. The samples of each pixel are grouped into depth bins
/// (docs/deep.md).
///
/// Each camera ray that hits a surface or scatters in a volume adds one sample to its pixel: a
/// depth and the radiance of the path. Samples of similar depth share a bin. The bins of a pixel
/// are disjoint depth ranges in ascending order. A bin stores the number n of its samples and the
/// sum C of their radiance. N is the number of samples of the pixel. The coverage of a bin is s = n
/// / N, and r is the part of the pixel that the bins in front of it do not cover:
///   r_0 = 1,  r_{i+1} = r_i - s_i,   alpha_i = s_i / r_i,   color_i = C_i / (N r_i).
/// Compositing the bins with "over", sum_i color_i prod_{j<i} (1 - alpha_j), gives sum_i C_i / N,
/// which is the colour of the pixel in the flat image, and the covered fraction of the pixel as
/// alpha.
///
/// A pixel has at most `DeepLimits::most` bins. If a sample would exceed this limit, two
/// neighbouring bins are merged: the pair whose combined depth range is the smallest relative to
/// its depth.
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

/// Allocator that uses calloc, so that pages of zeroed memory take no physical memory until they
/// are written. The default value of the element type must consist of zero bytes.
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

/// Deep samples of an image, in row-major order of the pixels.
struct DeepLayer {
  /// Number of channels of a deep sample: R, G, B, A, Z and ZBack. Colours are multiplied by alpha.
  static constexpr size_t kChannels = 6;
  std::vector<uint32_t> counts;  ///< number of deep samples of each pixel
  /// `kChannels` values for each deep sample. The samples of a pixel are in order of increasing
  /// depth.
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
  /// Allocates memory for `limits.most` bins per pixel. Throws std::bad_alloc if the allocation
  /// fails.
  DeepFilm(size_t pixels, const DeepLimits& limits);

  bool empty() const { return used_.empty(); }
  /// Adds a sample to the pixel with the index `pixel`. `z` is its depth, which must not be
  /// negative. `rgb` is the radiance of the path. `in_volume` is true if the camera ray scattered
  /// in a volume.
  void add(size_t pixel, float z, bool in_volume, const float* rgb);
  /// Returns the deep samples of all pixels. `samples` is the sample count of each pixel.
  DeepLayer layer(const std::vector<uint32_t>& samples) const;
  /// Returns the state of the deep image for checkpoints. The state consists of one byte per pixel
  /// with the number of the pixel's bins, followed by the bins of all pixels.
  std::vector<std::byte> packed() const;
  /// Restores the state that packed() returned. Throws `Error` if the bytes do not match the size
  /// of this image.
  void unpack(std::span<const std::byte> bytes);
  /// Returns an upper bound of the memory use in bytes.
  size_t bytes() const { return used_.size() * (1 + limits_.most * sizeof(DeepBin)); }

 private:
  DeepBin& bin(size_t pixel, uint32_t i) { return bins_[i * used_.size() + pixel]; }
  const DeepBin& bin(size_t pixel, uint32_t i) const { return bins_[i * used_.size() + pixel]; }
  void insert(size_t pixel, uint32_t at, const DeepBin& added);

  DeepLimits limits_;
  std::vector<uint8_t> used_;  ///< number of bins in use for each pixel
  /// Bin 0 of all pixels, followed by bin 1 of all pixels, and so on. With this layout, memory
  /// pages of bins that no pixel uses take no physical memory.
  std::vector<DeepBin, ZeroedMemory<DeepBin>> bins_;
};

}  // namespace wavecomb
