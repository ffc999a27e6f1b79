// SPDX-License-Identifier: Apache-2.0
/// The picture while it grows.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

namespace wavecomb {

/// Sums of samples per pixel, in double precision, so that 65,536 samples stay exact to float.
///
/// Contract: a pixel is written by one thread at a time, its samples in sample order; different
/// pixels may be written at once. Row 0 is the top.
class Film {
 public:
  Film(uint32_t width, uint32_t height, bool with_aovs);

  /// Sums of one pixel.
  struct Pixel {
    double r = 0, g = 0, b = 0;
    uint32_t samples = 0;
  };
  struct AovPixel {
    double albedo[3] = {0, 0, 0};
    double normal[3] = {0, 0, 0};
    double depth = 0;  ///< sum over samples that hit something
    uint32_t depth_samples = 0;
  };

  uint32_t width() const { return width_; }
  uint32_t height() const { return height_; }
  bool has_aovs() const { return !aovs_.empty(); }
  Pixel& pixel(uint32_t x, uint32_t y) { return pixels_[size_t{y} * width_ + x]; }
  /// Memory of the sums.
  size_t bytes() const { return pixels_.size() * sizeof(Pixel) + aovs_.size() * sizeof(AovPixel); }
  AovPixel& aov(uint32_t x, uint32_t y) { return aovs_[size_t{y} * width_ + x]; }

  /// Means: rgb interleaved; black where a pixel has no samples.
  std::vector<float> beauty() const;
  std::vector<float> albedo() const;
  /// Mean normals, not normalised.
  std::vector<float> normal() const;
  /// Mean depth of samples that hit; infinite where none did.
  std::vector<float> depth() const;
  std::vector<uint32_t> samples() const;

  /// All of these.
  struct Layers {
    std::vector<float> beauty, albedo, normal, depth;
    std::vector<uint32_t> samples;
  };
  /// The means, and the end of the film: sums are freed as soon as they were used, for sums and
  /// layers together are the most memory that a small scene needs.
  Layers finish() &&;

 private:
  uint32_t width_, height_;
  std::vector<Pixel> pixels_;
  std::vector<AovPixel> aovs_;
};

}  // namespace wavecomb
