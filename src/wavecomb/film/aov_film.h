// SPDX-License-Identifier: Apache-2.0
/// What a film keeps beside the beauty: only what is asked for takes room. How the samples of an
/// AOV are put together is said by its row (core/aov.h); what they are, by who adds them.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "wavecomb/core/aov.h"
#include "wavecomb/film/cryptomatte.h"
#include "wavecomb/film/deep_film.h"
#include "wavecomb/film/median.h"
#include "wavecomb/film/splat_places.h"
#include "wavecomb/film/splats.h"

namespace wavecomb {

/// Material, instance or object where nothing was hit.
inline constexpr uint32_t kNothingHit = 0xffffffffu;

/// Ids are counted from 1 in pictures; 0 is nothing.
inline float id_value(uint32_t id) {
  return id == kNothingHit ? 0.f : static_cast<float>(id) + 1.f;
}

/// A layer of a picture: `channels` values a pixel, row 0 at the top.
struct AovLayer {
  std::string name;
  uint32_t channels = 1;
  std::vector<float> values;
};

/// The sums behind the AOVs of a film, pixel by pixel.
///
/// Contract: as Film's: one thread a pixel at a time, a pixel's samples in sample order.
class AovFilm {
 public:
  AovFilm() = default;
  AovFilm(size_t pixels, const AovLayout& layout);

  static constexpr uint32_t kCryptoLevels = 3;
  /// Ids given for each pixel, of those that CryptoPixel holds: three layers of a file.
  static constexpr uint32_t kCryptoRanks = 6;

  const AovLayout& layout() const { return layout_; }

  // ---- one sample's values ----------------------------------------------------------------------

  /// Sums of an AOV that is a mean, a sum or a median, by channel; null where it is not kept. Those
  /// of light groups stand side by side, and those of expressions.
  double* sums(Aov aov, size_t pixel) {
    std::vector<double>& all = sums_[place_of(aov)];
    return all.empty() ? nullptr : all.data() + pixel * words_of(row_of(aov));
  }
  /// Adds the channels of an AOV that is kept.
  void add(Aov aov, size_t pixel, const float* values) {
    double* to = sums(aov, pixel);
    for (uint32_t c = 0; c < row_of(aov).channels; ++c) to[c] += double{values[c]};
  }
  /// Adds a number, infinite where there is none, to an AOV that is a median.
  void add_to_median(Aov aov, size_t pixel, float value) {
    MedianSketch(sums(aov, pixel)).add(double{value});
  }
  /// A sample has hit something: counts for means of hits.
  void count_hit(size_t pixel) { ++hits_[pixel]; }
  /// Whether a sample at this squared distance from the pixel's centre, in pixels, is the nearest
  /// so far, the first among equals. It is to be put then.
  bool is_nearest(size_t pixel, float centre2) {
    if (!(centre2 < centre2_[pixel])) return false;
    centre2_[pixel] = centre2;
    return true;
  }
  /// The channels of an AOV of the nearest sample; nothing where it is not kept.
  void put(Aov aov, size_t pixel, const float* values) {
    std::vector<float>& all = nearest_[place_of(aov)];
    for (uint32_t c = 0; c < row_of(aov).channels && !all.empty(); ++c)
      all[pixel * row_of(aov).channels + c] = values[c];
  }
  /// What a sample has met, as ObjectNames numbers it, or kNothingHit.
  void add_ids(size_t pixel, uint32_t object, uint32_t material, const CryptoTables& tables) {
    if (object != kNothingHit) {
      if (!crypto_[0].empty()) crypto_[0][pixel].add(tables.object_id[object]);
      if (!crypto_[2].empty()) crypto_[2][pixel].add(tables.asset_id[object]);
    }
    if (material != kNothingHit && !crypto_[1].empty())
      crypto_[1][pixel].add(tables.material_id[material]);
  }

  /// The sums of a deep picture; empty where none is kept.
  DeepFilm& deep() { return deep_; }

  // ---- light that paths from the lights bring ---------------------------------------------------

  /// Keeps it from now on, in units of `unit`, for the layers that hold any.
  void keep_splats(FixedPoint unit) { splats_ = SplatSums(pixels_ * splat_places_.count, unit); }
  /// Adds light to a pixel of layer `place` (SplatPlaces), in any order.
  void add_splat(size_t pixel, uint32_t place, float r, float g, float b) {
    splats_.add(pixel * splat_places_.count + place, r, g, b);
  }
  /// How sums of splats are made means of, from now on.
  void scale_splats(const SplatScale& scale) { splat_scale_ = scale; }

  // ---- layers -----------------------------------------------------------------------------------

  /// The layer of an AOV that has one alone; no values where it is not kept. `samples` is by pixel.
  AovLayer layer(Aov aov, const std::vector<uint32_t>& samples) const;
  /// The same by name, "light_NAME" and "lpe_NAME" among them; no name where it is not
  /// kept. `many_names`: of the light groups that are kept, then of the expressions.
  AovLayer layer(const std::string& name, const std::vector<uint32_t>& samples,
                 const std::vector<std::string>& many_names) const;
  /// The layer of an AOV, whose sums are freed.
  AovLayer take(Aov aov, const std::vector<uint32_t>& samples);
  /// All that are kept and were not taken, and the end of the film: sums are freed as soon as they
  /// were used. Light groups are called "light_" and their name.
  std::vector<AovLayer> finish(const std::vector<uint32_t>& samples,
                               const std::vector<std::string>& many_names) &&;
  size_t bytes() const;
  /// The deep picture, whose sums are freed; empty where none is kept.
  DeepLayer take_deep(const std::vector<uint32_t>& samples);
  /// Runs block(name, values) for each vector of sums, for checkpoints; those
  /// of a deep picture have DeepFilm::packed().
  template <typename Block>
  void for_each_block(const Block& block) {
    for (const AovRow& row : kAovs) {
      const std::string name = std::string("aov_") + row.name;
      block(name, sums_[place_of(row.aov)]);
      block(name, nearest_[place_of(row.aov)]);
      if (row.kind == AovKind::kCoverage) block(name, crypto_[level_index(row.aov)]);
    }
    block("aov_splats", splats_.sums());
    block("aov_hits", hits_);
    block("aov_centre", centre2_);
  }

 private:
  static uint32_t level_index(Aov level) { return place_of(level) - place_of(Aov::kCryptoObject); }
  /// Sums of a pixel.
  size_t words_of(const AovRow& row) const {
    if (row.kind == AovKind::kGroups) return 3 * layout_.light_groups;
    if (row.kind == AovKind::kMedian) return MedianSketch::kWords;
    return row.kind == AovKind::kExpressions ? 3 * layout_.expressions : row.channels;
  }
  AovLayer crypto_layer(Aov level, const std::vector<uint32_t>& samples) const;
  /// Layer `which` of the light groups or the expressions.
  AovLayer one_of_many(Aov aov, uint32_t which, std::string name,
                       const std::vector<uint32_t>& samples) const;
  /// Runs layer(aov, which, name) for each of those.
  template <typename Layer>
  void for_each_of_many(const std::vector<std::string>& many_names, const Layer& layer) const;

  /// What splats bring channel `c` of layer `place`, which may be kNowhere.
  double splat_mean(size_t pixel, uint32_t place, size_t c) const {
    if (splats_.empty() || place == SplatPlaces::kNowhere) return 0;
    return splat_scale_.of(splats_.value(pixel * splat_places_.count + place, c));
  }

  AovLayout layout_;
  SplatPlaces splat_places_;
  size_t pixels_ = 0;
  // By the place of an AOV's row; empty where it is not kept.
  std::array<std::vector<double>, kAovCount> sums_;
  std::array<std::vector<float>, kAovCount> nearest_;
  std::array<std::vector<CryptoPixel>, kCryptoLevels> crypto_;
  SplatSums splats_;  ///< places of a pixel side by side; empty where there are none
  SplatScale splat_scale_;
  DeepFilm deep_;
  std::vector<uint32_t> hits_;  ///< samples that have hit something
  std::vector<float> centre2_;  ///< squared distance of the nearest sample, pixels
};

/// Sorted ids in a Cryptomatte's layer.
std::vector<uint32_t> crypto_ids(const AovLayer& pairs);

}  // namespace wavecomb
