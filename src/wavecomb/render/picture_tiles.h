// SPDX-License-Identifier: Apache-2.0
/// How bright the picture is, roughly: what paths before the first pass brought, by tiles.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "wavecomb/core/settings.h"
#include "wavecomb/learn/guide_view.h"

namespace wavecomb {

/// The whole picture in at most 16 x 16 tiles of 64 paths or more. The same for paths in any order:
/// sums are integers.
class PictureTiles {
 public:
  /// Path i is of pixel pixels[i] (x | y << 16) and brought luminance[i].
  PictureTiles(const Settings& settings, std::span<const uint32_t> pixels,
               std::span<const float> luminance);
  /// Tiles of before: inverse_scales() of a picture of this size. Throws Error for what cannot be.
  PictureTiles(const Settings& settings, std::vector<double> inverse_scales);

  uint32_t count() const { return rows_ * rows_; }
  /// The tile of a pixel.
  uint32_t of(uint32_t pixel) const;
  /// Whether any path brought light.
  bool is_lit() const { return !inverse_.empty(); }
  /// One over the scale of the picture at a pixel: of the mean of what paths of its tile bring,
  /// none above 64 medians. Contract: is_lit().
  double inverse_scale(uint32_t pixel) const { return inverse_[of(pixel)]; }
  /// By tile, row by row; empty where no path brought light.
  const std::vector<double>& inverse_scales() const { return inverse_; }
  /// Lets kernels know it, where any path brought light.
  void apply(GuideView& view) const;

 private:
  uint32_t width_, height_, rows_ = 1;
  std::vector<double> inverse_;
  std::vector<float> table_;  ///< the same
};

}  // namespace wavecomb
