// SPDX-License-Identifier: Apache-2.0
/// The picture while it grows.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "wavecomb/core/settings.h"
#include "wavecomb/film/aov_film.h"
#include "wavecomb/film/cascades.h"
#include "wavecomb/film/error_sums.h"
#include "wavecomb/film/splats.h"

namespace wavecomb {

/// Sums of samples per pixel, in double precision, so that 65,536 samples stay exact to float.
///
/// Contract: a pixel is written by one thread at a time, its samples in sample order; different
/// pixels may be written at once. Splats are added by whom and when they come. Row 0 is the top of
/// the window; places (x, y) are the picture's.
class Film {
 public:
  /// Of the pixels of `window`. `with_error`: keeps what errors and variances are told from.
  Film(const Region& window, const AovLayout& aovs, bool with_error = false);
  /// Of a whole picture.
  Film(uint32_t width, uint32_t height, const AovLayout& aovs, bool with_error = false)
      : Film(Region{0, 0, width, height}, aovs, with_error) {}

  /// Sums of one pixel.
  struct Pixel {
    double r = 0, g = 0, b = 0;
    uint32_t samples = 0;
  };

  uint32_t width() const { return window_.width(); }
  uint32_t height() const { return window_.height(); }
  /// The pixels of the picture that it has.
  const Region& window() const { return window_; }
  bool has_error() const { return !errors_.empty(); }
  Pixel& pixel(uint32_t x, uint32_t y) { return pixels_[index(x, y)]; }
  ErrorSums& error(uint32_t x, uint32_t y) { return errors_[index(x, y)]; }
  /// Keeps splats from now on, in units of `unit`, of `paths` numbers of paths, `scale` a sample;
  /// the beauty is then the pixel's mean and theirs. AOVs keep theirs, too.
  void keep_splats(FixedPoint unit, size_t paths = 0, double scale = 1) {
    splats_ = SplatLayer(pixels_.size(), unit, paths, scale, has_error());
    aovs_.keep_splats(unit);
  }
  /// Keeps a row of so many words for each pixel from now on (integrate/visible_points.h).
  static constexpr size_t kVisibleWords = 16;
  void keep_visible_points() { visible_.assign(pixels_.size() * kVisibleWords, 0.f); }
  std::span<const float> visible_points() const { return visible_; }
  void set_visible_point(size_t i, const float* row) {
    std::copy_n(row, kVisibleWords, visible_.data() + i * kVisibleWords);
  }
  /// Adds all of a list, which is empty then.
  void take(SplatList& list) {
    splats_.add(list);
    list.clear();
  }
  /// Adds a splat to a list, which is taken where it is full.
  void collect(SplatList& list, const SplatList::Splat& splat) {
    if (list.add(splat)) return;
    take(list);
    (void)list.add(splat);
  }
  /// Keeps samples by brightness from now on; the beauty is then reweighted. `darkest`: the
  /// brightness of their first layer.
  void keep_cascades(float darkest) { cascades_ = Cascades(window_, darkest); }
  bool has_cascades() const { return !cascades_.empty(); }
  Cascades& cascades() { return cascades_; }
  /// Brings AOVs that hold what light paths bring to what splats tell now.
  void note_light_paths();
  SplatLayer& splats() { return splats_; }
  const SplatLayer& splats() const { return splats_; }
  /// Number of a pixel of the picture, row by row of the window.
  size_t index(uint32_t x, uint32_t y) const { return window_.index(x, y); }
  const Pixel& pixel(size_t i) const { return pixels_[i]; }
  const ErrorSums& error(size_t i) const { return errors_[i]; }
  size_t pixel_count() const { return pixels_.size(); }
  AovFilm& aovs() { return aovs_; }
  const AovFilm& aovs() const { return aovs_; }
  /// Memory of the sums.
  size_t bytes() const {
    return pixels_.size() * sizeof(Pixel) + aovs_.bytes() + errors_.size() * sizeof(ErrorSums) +
           splats_.bytes() + cascades_.bytes() + visible_.size() * sizeof(float);
  }

  /// Means: rgb interleaved; black where a pixel has neither samples nor splats. Reweighted, where
  /// cascades are kept.
  std::vector<float> beauty() const;
  /// The same, not reweighted.
  std::vector<float> unbiased() const { return means({}); }
  /// Empty where not kept.
  std::vector<float> albedo() const;
  /// Mean normals, not normalised.
  std::vector<float> normal() const;
  /// Mean depth of samples that hit; infinite where none did.
  std::vector<float> depth() const;
  std::vector<uint32_t> samples() const;
  /// Variance of each pixel's mean, rgb, as if samples were independent; infinite below two
  /// samples. Empty without error sums.
  std::vector<float> variance() const;

  /// All that the film holds but for deep samples, for checkpoints: what is copied out of the
  /// blocks of one film and into those of another of the same size makes it the same.
  struct Block {
    std::string name;
    std::span<std::byte> bytes;
  };
  std::vector<Block> blocks();

  /// All of these; empty where not kept.
  struct Layers {
    std::vector<float> beauty, albedo, normal, depth, variance;
    std::vector<uint32_t> samples;
    std::vector<AovLayer> aovs;  ///< of AovFilm::finish; "unbiased", where it is not the beauty
    DeepLayer deep;
  };
  /// The means, and the end of the film: sums are freed as soon as they were used, for sums and
  /// layers together are the most memory that a small scene needs.
  /// `many_names`: AovFilm::layer's.
  Layers finish(const std::vector<std::string>& many_names) &&;

 private:
  /// Means without `excess`, rgb interleaved; empty: nothing.
  std::vector<float> means(const std::vector<float>& excess) const;

  Region window_;
  std::vector<Pixel> pixels_;
  AovFilm aovs_;
  std::vector<ErrorSums> errors_;
  SplatLayer splats_;  ///< empty where none are kept
  Cascades cascades_;  ///< likewise
  std::vector<float> visible_;
};

}  // namespace wavecomb
