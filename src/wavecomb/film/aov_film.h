// SPDX-License-Identifier: Apache-2.0
/// Storage for the AOVs (arbitrary output variables) of a render. Memory is allocated only for
/// requested AOVs. The table in core/aov.h defines how the samples of each AOV are combined.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "wavecomb/core/aov.h"
#include "wavecomb/film/cryptomatte.h"
#include "wavecomb/film/deep_film.h"
#include "wavecomb/film/median.h"
#include "wavecomb/film/splats/light_splat_layout.h"
#include "wavecomb/film/splats/light_splats.h"

namespace wavecomb {

/// Material, instance or object id of a sample that hit nothing.
inline constexpr uint32_t kNoHitId = 0xffffffffu;

/// Returns the value that represents an id in an image layer, which is the id plus 1, or 0 for
/// `kNoHitId`.
inline float id_value(uint32_t id) {
  return id == kNoHitId ? 0.f : static_cast<float>(id) + 1.f;
}

/// Image layer with `channels` interleaved values per pixel. Row 0 is at the top of the image.
struct AovLayer {
  std::string name;
  uint32_t channels = 1;
  std::vector<float> values;
};

/// Per-pixel sums from which the AOV layers of a film are computed.
///
/// Contract: at most one thread writes to a pixel at a time and adds its samples in sample order.
class AovFilm {
 public:
  AovFilm() = default;
  AovFilm(size_t pixels, const AovLayout& layout);

  /// Number of Cryptomatte levels, which are objects, materials and assets.
  static constexpr uint32_t kCryptoLevels = 3;
  /// Number of ids per pixel in the image. `CryptoPixel` counts more ids than these. An RGBA layer
  /// contains two ids with their coverage, so image files have three layers per Cryptomatte level.
  static constexpr uint32_t kCryptoRanks = 6;

  const AovLayout& layout() const { return layout_; }

  // ---- adding samples ---------------------------------------------------------------------------

  /// Returns the sums of an AOV at `pixel`, one per channel, or null if the AOV is not stored. The
  /// AOV must be a mean, sum or median. The sums of light groups are consecutive RGB triples, as
  /// are the sums of light path expressions.
  double* sums(Aov aov, size_t pixel) {
    std::vector<double>& all = sums_[aov_index(aov)];
    return all.empty() ? nullptr : all.data() + pixel * words_of(row_of(aov));
  }
  /// Adds `values`, one per channel, to the sums of an AOV, which must be stored.
  void add(Aov aov, size_t pixel, const float* values) {
    double* to = sums(aov, pixel);
    for (uint32_t c = 0; c < row_of(aov).channels; ++c) to[c] += double{values[c]};
  }
  /// Adds a value to an AOV of kind `kMedian`, which must be stored. Infinity means that the sample
  /// has no value.
  void add_to_median(Aov aov, size_t pixel, float value) {
    MedianSketch(sums(aov, pixel)).add(double{value});
  }
  /// Counts a sample that hit something, for AOVs of kind `kMeanOfHits`.
  void count_hit(size_t pixel) { ++hits_[pixel]; }
  /// Returns whether a sample is nearer to the pixel centre than all earlier samples of the pixel,
  /// and records its distance. `centre2` is the squared distance in pixels. If the result is true,
  /// the caller must store the sample's values with put().
  bool is_nearest(size_t pixel, float centre2) {
    if (!(centre2 < centre2_[pixel])) return false;
    centre2_[pixel] = centre2;
    return true;
  }
  /// Replaces the values of an AOV of kind `kNearest`. Does nothing if the AOV is not stored.
  void put(Aov aov, size_t pixel, const float* values) {
    std::vector<float>& all = nearest_[aov_index(aov)];
    for (uint32_t c = 0; c < row_of(aov).channels && !all.empty(); ++c)
      all[pixel * row_of(aov).channels + c] = values[c];
  }
  /// Adds a sample to the Cryptomatte levels. `object` is an index into `ObjectNames`. `object` and
  /// `material` are `kNoHitId` if the sample hit nothing.
  void add_ids(size_t pixel, uint32_t object, uint32_t material, const CryptoTables& tables) {
    if (object != kNoHitId) {
      if (!crypto_[0].empty()) crypto_[0][pixel].add(tables.object_id[object]);
      if (!crypto_[2].empty()) crypto_[2][pixel].add(tables.asset_id[object]);
    }
    if (material != kNoHitId && !crypto_[1].empty())
      crypto_[1][pixel].add(tables.material_id[material]);
  }

  /// Returns the sums of the deep image, which are empty if the render has no deep image.
  DeepFilm& deep() { return deep_; }

  // ---- light splats (contributions of light paths) ----------------------------------------------

  /// Allocates fixed-point sums of light splats in units of `unit`, for the AOV layers that include
  /// light splats.
  void allocate_light_splats(FixedPoint unit) {
    splats_ = LightSplatSums(pixels_ * light_splat_layout_.count, unit);
  }
  /// Adds a light splat to a pixel of the layer `sum_index` (see `LightSplatLayout`). Light splats
  /// may be added in any order.
  void add_light_splat(size_t pixel, uint32_t sum_index, float r, float g, float b) {
    splats_.add(pixel * light_splat_layout_.count + sum_index, r, g, b);
  }
  /// Sets the factor by which sums of light splats are multiplied to get means.
  void set_light_splat_scale(const LightSplatScale& scale) { light_splat_scale_ = scale; }

  // ---- layers -----------------------------------------------------------------------------------

  /// Returns the layer of an AOV that has exactly one layer. The layer has no values if the AOV is
  /// not stored. `samples` is the sample count of each pixel.
  AovLayer layer(Aov aov, const std::vector<uint32_t>& samples) const;
  /// Returns the layer with the name `name`, such as "light_NAME" or "lpe_NAME". The result has an
  /// empty name if no such layer is stored. `multi_layer_names` contains the names of the stored
  /// light groups, followed by the names of the light path expressions.
  AovLayer layer(const std::string& name, const std::vector<uint32_t>& samples,
                 const std::vector<std::string>& multi_layer_names) const;
  /// Returns the layer of an AOV and frees its sums.
  AovLayer take(Aov aov, const std::vector<uint32_t>& samples);
  /// Returns all stored layers except those that take() has returned. The sums of each AOV are
  /// freed as soon as its layer is complete. Layers of light groups are named "light_NAME", and
  /// layers of light path expressions "lpe_NAME".
  std::vector<AovLayer> finish(const std::vector<uint32_t>& samples,
                               const std::vector<std::string>& multi_layer_names) &&;
  size_t bytes() const;
  /// Returns the deep image and frees its sums. The result is empty if the render has no deep
  /// image.
  DeepLayer take_deep(const std::vector<uint32_t>& samples);
  /// Calls `block(name, values)` for each vector of sums, to write or read checkpoints. The sums of
  /// the deep image are left out, since `DeepFilm::packed` returns them.
  template <typename Block>
  void for_each_block(const Block& block) {
    for (const AovRow& row : kAovs) {
      const std::string name = std::string("aov_") + row.name;
      block(name, sums_[aov_index(row.aov)]);
      block(name, nearest_[aov_index(row.aov)]);
      if (row.kind == AovKind::kCoverage) block(name, crypto_[level_index(row.aov)]);
    }
    block("aov_splats", splats_.sums());
    block("aov_hits", hits_);
    block("aov_centre", centre2_);
  }

 private:
  static uint32_t level_index(Aov level) {
    return aov_index(level) - aov_index(Aov::kCryptoObject);
  }
  /// Returns the number of values per pixel in the sums of an AOV.
  size_t words_of(const AovRow& row) const {
    if (row.kind == AovKind::kGroups) return 3 * layout_.light_groups;
    if (row.kind == AovKind::kMedian) return MedianSketch::kWords;
    return row.kind == AovKind::kExpressions ? 3 * layout_.expressions : row.channels;
  }
  AovLayer crypto_layer(Aov level, const std::vector<uint32_t>& samples) const;
  /// Returns layer number `which` of an AOV with several layers (light groups or light path
  /// expressions).
  AovLayer multi_layer(Aov aov, uint32_t which, std::string name,
                       const std::vector<uint32_t>& samples) const;
  /// Calls `layer(aov, which, name)` for each stored light group and light path expression.
  template <typename Layer>
  void for_each_multi_layer(const std::vector<std::string>& multi_layer_names,
                            const Layer& layer) const;

  /// Returns the contribution of light splats to channel `c` of the layer `sum_index`, or 0 if
  /// `sum_index` is `kNotStored`.
  double light_splat_mean(size_t pixel, uint32_t sum_index, size_t c) const {
    if (splats_.empty() || sum_index == LightSplatLayout::kNotStored) return 0;
    return light_splat_scale_.of(splats_.value(pixel * light_splat_layout_.count + sum_index, c));
  }

  AovLayout layout_;
  LightSplatLayout light_splat_layout_;
  size_t pixels_ = 0;
  // Sums and nearest values of the pixels for each AOV, indexed by `aov_index(aov)`. The vectors of
  // AOVs that are not stored are empty.
  std::array<std::vector<double>, kAovCount> sums_;
  std::array<std::vector<float>, kAovCount> nearest_;
  std::array<std::vector<CryptoPixel>, kCryptoLevels> crypto_;
  /// Sums of light splats, with the index pixel * light_splat_layout_.count + sum index. Empty if
  /// the render has no light splats.
  LightSplatSums splats_;
  LightSplatScale light_splat_scale_;
  DeepFilm deep_;
  std::vector<uint32_t> hits_;  ///< number of samples per pixel that hit something
  std::vector<float> centre2_;  ///< squared distance of each pixel's nearest sample from the pixel
                                ///< centre, in pixels
};

/// Returns the ids in a Cryptomatte layer, sorted and without duplicates.
std::vector<uint32_t> crypto_ids(const AovLayer& pairs);

}  // namespace wavecomb
