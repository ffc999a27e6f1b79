// SPDX-License-Identifier: Apache-2.0
/// The picture while it grows.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "wavecomb/film/error_sums.h"

namespace wavecomb {

/// Sums of samples per pixel, in double precision, so that 65,536 samples stay exact to float.
///
/// Contract: a pixel is written by one thread at a time, its samples in sample order; different
/// pixels may be written at once. Row 0 is the top.
class Film {
 public:
  /// `with_error`: keeps what errors and variances are told from.
  Film(uint32_t width, uint32_t height, bool with_aovs, bool with_error = false);

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
  bool has_error() const { return !errors_.empty(); }
  Pixel& pixel(uint32_t x, uint32_t y) { return pixels_[size_t{y} * width_ + x]; }
  ErrorSums& error(uint32_t x, uint32_t y) { return errors_[size_t{y} * width_ + x]; }
  /// By number, row by row.
  const Pixel& pixel(size_t i) const { return pixels_[i]; }
  const ErrorSums& error(size_t i) const { return errors_[i]; }
  size_t pixel_count() const { return pixels_.size(); }
  /// Memory of the sums.
  size_t bytes() const {
    return pixels_.size() * sizeof(Pixel) + aovs_.size() * sizeof(AovPixel) +
           errors_.size() * sizeof(ErrorSums);
  }
  AovPixel& aov(uint32_t x, uint32_t y) { return aovs_[size_t{y} * width_ + x]; }

  /// Means: rgb interleaved; black where a pixel has no samples.
  std::vector<float> beauty() const;
  std::vector<float> albedo() const;
  /// Mean normals, not normalised.
  std::vector<float> normal() const;
  /// Mean depth of samples that hit; infinite where none did.
  std::vector<float> depth() const;
  std::vector<uint32_t> samples() const;
  /// Variance of each pixel's mean, rgb, as if samples were independent; infinite below two
  /// samples. Empty without error sums.
  std::vector<float> variance() const;

  /// All that the film holds, for checkpoints: what is copied out of the blocks of one film and
  /// into those of another of the same size makes it the same.
  struct Block {
    std::string name;
    std::span<std::byte> bytes;
  };
  std::vector<Block> blocks();

  /// All of these.
  struct Layers {
    std::vector<float> beauty, albedo, normal, depth, variance;
    std::vector<uint32_t> samples;
  };
  /// The means, and the end of the film: sums are freed as soon as they were used, for sums and
  /// layers together are the most memory that a small scene needs.
  Layers finish() &&;

 private:
  uint32_t width_, height_;
  std::vector<Pixel> pixels_;
  std::vector<AovPixel> aovs_;
  std::vector<ErrorSums> errors_;
};

}  // namespace wavecomb
