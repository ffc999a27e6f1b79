// SPDX-License-Identifier: Apache-2.0
/// Film of a render, which adds samples to pixels and returns the image.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "wavecomb/core/aov.h"
#include "wavecomb/core/settings_choices.h"
#include "wavecomb/film/aov_film.h"
#include "wavecomb/film/cascades.h"
#include "wavecomb/film/error/error_sums.h"
#include "wavecomb/film/splats/light_splats.h"

namespace wavecomb {

/// Sums of the samples of each pixel. The sums have double precision, so that the mean of 65,536
/// samples is exact to float precision.
///
/// Contract: at most one thread writes to a pixel at a time and adds its samples in sample order;
/// different pixels may be written concurrently. Light splats may be added by any thread in any
/// order. Row 0 is at the top of the window. Coordinates (x, y) are relative to the whole image.
class Film {
 public:
  /// Creates a film for the pixels of `window`. If `with_error` is true, the film also stores sums
  /// for error and variance estimates.
  Film(const Region& window, const AovLayout& aovs, bool with_error = false);
  /// Creates a film for a whole image.
  Film(uint32_t width, uint32_t height, const AovLayout& aovs, bool with_error = false)
      : Film(Region{0, 0, width, height}, aovs, with_error) {}

  /// Sums of the samples of one pixel.
  struct Pixel {
    double r = 0, g = 0, b = 0;
    uint32_t samples = 0;
  };

  uint32_t width() const { return window_.width(); }
  uint32_t height() const { return window_.height(); }
  /// Returns the rectangle of pixels that this film covers.
  const Region& window() const { return window_; }
  bool has_error() const { return !errors_.empty(); }
  Pixel& pixel(uint32_t x, uint32_t y) { return pixels_[index(x, y)]; }
  ErrorSums& error(uint32_t x, uint32_t y) { return errors_[index(x, y)]; }
  /// Allocates fixed-point sums of light splats in units of `unit`, for the beauty and for AOVs
  /// that include light splats. `paths` is the number of light path indices. Each index stands for
  /// `scale` light paths per sample. With light splats, the beauty is the sum of the means of
  /// camera paths and light splats.
  void allocate_light_splats(FixedPoint unit, size_t paths = 0, double scale = 1) {
    splats_ = LightSplatLayer(pixels_.size(), unit, paths, scale, has_error());
    aovs_.allocate_light_splats(unit);
  }
  /// Allocates a row of `words` floats for each pixel. A light transport that combines camera paths
  /// and light paths stores data of the camera paths of a pass in these rows, until the light paths
  /// of the pass are traced.
  void allocate_joint_rows(size_t words) { joint_rows_.assign(pixels_.size() * words, 0.f); }
  std::span<const float> joint_rows() const { return joint_rows_; }
  /// Sets the row of pixel `i`, which must have been allocated by `allocate_joint_rows`.
  void set_joint_row(size_t i, std::span<const float> row) {
    std::copy(row.begin(), row.end(), joint_rows_.data() + i * row.size());
  }
  /// Adds all light splats of `list` to the film and clears the list.
  void take(LightSplatList& list) {
    splats_.add(list);
    list.clear();
  }
  /// Adds a light splat to `list`. If the list is full, first adds the splats of the list to the
  /// film and clears the list.
  void collect(LightSplatList& list, const LightSplatList::LightSplat& splat) {
    if (list.add(splat)) return;
    take(list);
    (void)list.add(splat);
  }
  /// Allocates brightness cascades, so that beauty() reduces fireflies. `darkest` is the luminance
  /// of the darkest layer of the cascades.
  void allocate_cascades(float darkest) { cascades_ = Cascades(window_, darkest); }
  bool has_cascades() const { return !cascades_.empty(); }
  Cascades& cascades() { return cascades_; }
  /// Computes the values of AOVs that contain light splats from the current sums of light splats.
  void update_splat_aovs();
  LightSplatLayer& splats() { return splats_; }
  const LightSplatLayer& splats() const { return splats_; }
  /// Returns the index of the pixel (x, y) in row-major order of the window.
  size_t index(uint32_t x, uint32_t y) const { return window_.index(x, y); }
  const Pixel& pixel(size_t i) const { return pixels_[i]; }
  const ErrorSums& error(size_t i) const { return errors_[i]; }
  size_t pixel_count() const { return pixels_.size(); }
  AovFilm& aovs() { return aovs_; }
  const AovFilm& aovs() const { return aovs_; }
  /// Returns the memory use in bytes.
  size_t bytes() const {
    return pixels_.size() * sizeof(Pixel) + aovs_.bytes() + errors_.size() * sizeof(ErrorSums) +
           splats_.bytes() + cascades_.bytes() + joint_rows_.size() * sizeof(float);
  }

  /// Returns the mean of each pixel as interleaved RGB values, after firefly reduction if the film
  /// has cascades. Pixels without samples and light splats are black.
  std::vector<float> beauty() const;
  /// Returns the mean of each pixel as interleaved RGB values, without firefly reduction.
  std::vector<float> unbiased() const { return means({}); }
  /// Returns the mean albedo of each pixel. The result is empty if the AOV is not stored.
  std::vector<float> albedo() const;
  /// Returns the mean of the unit normals in each pixel, which is not a unit vector. The result is
  /// empty if the AOV is not stored.
  std::vector<float> normal() const;
  /// Returns the mean depth of the samples in each pixel that hit something, or infinity if no
  /// sample did. The result is empty if the AOV is not stored.
  std::vector<float> depth() const;
  /// Returns the sample count of each pixel.
  std::vector<uint32_t> samples() const;
  /// Returns the variance (rgb) of each pixel's mean, under the assumption of independent samples.
  /// The variance is infinite for pixels with fewer than two samples. The result is empty if the
  /// film has no error sums.
  std::vector<float> variance() const;

  /// Named memory block of the film's state. To restore a film from a checkpoint, copy all blocks
  /// to a film of the same size and layout. The sums of the deep image are stored separately.
  struct Block {
    std::string name;
    std::span<std::byte> bytes;
  };
  std::vector<Block> blocks();

  /// Image layers of a finished render. Layers of AOVs that are not stored are empty.
  struct Layers {
    std::vector<float> beauty, albedo, normal, depth, variance;
    std::vector<uint32_t> samples;
    /// Layers that `AovFilm::finish` returns. If fireflies are reduced, the layer "unbiased"
    /// contains the beauty without firefly reduction.
    std::vector<AovLayer> aovs;
    DeepLayer deep;
  };
  /// Returns all layers. The film must not be used after this call. The sums of an AOV are freed as
  /// soon as its layer is complete, because in small scenes, sums and layers together determine the
  /// peak memory. `multi_layer_names`: see AovFilm::layer.
  Layers finish(const std::vector<std::string>& multi_layer_names) &&;

 private:
  /// Returns the mean of each pixel minus `excess` as interleaved RGB values. If `excess` is empty,
  /// nothing is subtracted.
  std::vector<float> means(const std::vector<float>& excess) const;

  Region window_;
  std::vector<Pixel> pixels_;
  AovFilm aovs_;
  std::vector<ErrorSums> errors_;
  LightSplatLayer splats_;  ///< empty if the render has no light splats
  Cascades cascades_;       ///< empty if the render has no firefly reduction
  std::vector<float> joint_rows_;
};

}  // namespace wavecomb
