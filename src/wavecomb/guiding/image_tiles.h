// SPDX-License-Identifier: Apache-2.0
/// Approximate brightness of the image in tiles, from paths traced before the first pass.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "wavecomb/core/settings_choices.h"
#include "wavecomb/guiding/field/field_view.h"

namespace wavecomb {

struct Settings;

/// Brightness of the whole image in at most 16 x 16 tiles, each with at least 64 paths. Sums are
/// integers, so the result does not depend on the order of the paths.
class ImageTiles {
 public:
  /// Path i belongs to pixel pixels[i] (x | y << 16), and its radiance has the luminance
  /// luminance[i].
  ImageTiles(const Settings& settings, std::span<const uint32_t> pixels,
             std::span<const float> luminance);
  /// Restores tiles from the values that inverse_scales() returned for an image of the same size.
  /// Throws Error if the number of tiles does not match the image size.
  ImageTiles(const Settings& settings, std::vector<double> inverse_scales);

  uint32_t count() const { return rows_ * rows_; }
  /// Returns the index of a pixel's tile.
  uint32_t of(uint32_t pixel) const;
  /// Returns whether any path contributed light.
  bool is_lit() const { return !inverse_.empty(); }
  /// Returns one over the brightness of the image at a pixel: the mean over its tile, in which the
  /// luminance of each path is clamped to 64 times the median luminance. Contract: is_lit().
  double inverse_scale(uint32_t pixel) const { return inverse_[of(pixel)]; }
  /// Inverse brightness by tile, row by row; empty if no path contributed light.
  const std::vector<double>& inverse_scales() const { return inverse_; }
  /// Sets the tiles of `view`, if any path contributed light.
  void apply(GuidingView& view) const;

 private:
  uint32_t width_, height_, rows_ = 1;
  std::vector<double> inverse_;
  std::vector<float> table_;  ///< the values of inverse_ in single precision
};

}  // namespace wavecomb
