// SPDX-License-Identifier: Apache-2.0
/// Storage for the AOVs (arbitrary output variables) of a render. Memory is allocated only for
/// requested AOVs. Each AOV's row in core/aov.h defines how its samples are combined; the caller
/// supplies the sample values.
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

/// Returns the value written to an id layer: the id plus 1, or 0 if nothing was hit.
inline float id_value(uint32_t id) {
  return id == kNoHitId ? 0.f : static_cast<float>(id) + 1.f;
}

/// Image layer with `channels` interleaved values per pixel; row 0 is at the top.
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

  /// Cryptomatte levels: object, material, asset.
  static constexpr uint32_t kCryptoLevels = 3;
  /// Number of ids written per pixel; CryptoPixel counts up to kIds. An RGBA layer holds two ids
  /// with their coverage, so files have three layers per level.
  static constexpr uint32_t kCryptoRanks = 6;

  const AovLayout& layout() const { return layout_; }

  // ---- adding samples ---------------------------------------------------------------------------

  /// Returns the sums of a mean, sum or median AOV at `pixel`, one per channel, or null if the AOV
  /// is not stored. Light groups are consecutive RGB triples, and so are light path expressions.
  double* sums(Aov aov, size_t pixel) {
    std::vector<double>& all = sums_[aov_index(aov)];
    return all.empty() ? nullptr : all.data() + pixel * words_of(row_of(aov));
  }
  /// Adds `values`, one per channel, to an AOV that is stored.
  void add(Aov aov, size_t pixel, const float* values) {
    double* to = sums(aov, pixel);
    for (uint32_t c = 0; c < row_of(aov).channels; ++c) to[c] += double{values[c]};
  }
  /// Adds a value to a stored median AOV; infinity means that the sample has no value.
  void add_to_median(Aov aov, size_t pixel, float value) {
    MedianSketch(sums(aov, pixel)).add(double{value});
  }
  /// Counts a sample that hit something, for AOVs that are means over hits.
  void count_hit(size_t pixel) { ++hits_[pixel]; }
  /// Returns whether a sample at squared distance `centre2` (pixels^2) from the pixel centre is
  /// closer than all earlier samples, and records the distance. If this returns true, the caller
  /// must put() the values of the sample.
  bool is_nearest(size_t pixel, float centre2) {
    if (!(centre2 < centre2_[pixel])) return false;
    centre2_[pixel] = centre2;
    return true;
  }
  /// Replaces the channels of a kNearest AOV; does nothing if the AOV is not stored.
  void put(Aov aov, size_t pixel, const float* values) {
    std::vector<float>& all = nearest_[aov_index(aov)];
    for (uint32_t c = 0; c < row_of(aov).channels && !all.empty(); ++c)
      all[pixel * row_of(aov).channels + c] = values[c];
  }
  /// Adds a sample to the Cryptomatte levels. `object` is an index of ObjectNames; `object` and
  /// `material` may be kNoHitId.
  void add_ids(size_t pixel, uint32_t object, uint32_t material, const CryptoTables& tables) {
    if (object != kNoHitId) {
      if (!crypto_[0].empty()) crypto_[0][pixel].add(tables.object_id[object]);
      if (!crypto_[2].empty()) crypto_[2][pixel].add(tables.asset_id[object]);
    }
    if (material != kNoHitId && !crypto_[1].empty())
      crypto_[1][pixel].add(tables.material_id[material]);
  }

  /// Sums of the deep image; empty if the render has no deep image.
  DeepFilm& deep() { return deep_; }

  // ---- light splats (contributions of light paths) ----------------------------------------------

  /// Allocates sums for light splats in units of `unit`, for the layers that include them.
  void allocate_light_splats(FixedPoint unit) {
    splats_ = LightSplatSums(pixels_ * light_splat_layout_.count, unit);
  }
  /// Adds a light splat to layer `sum_index` (see LightSplatLayout) of a pixel. The order of light
  /// splats does not matter.
  void add_light_splat(size_t pixel, uint32_t sum_index, float r, float g, float b) {
    splats_.add(pixel * light_splat_layout_.count + sum_index, r, g, b);
  }
  /// Sets the scale that turns sums of light splats into means.
  void set_light_splat_scale(const LightSplatScale& scale) { light_splat_scale_ = scale; }

  // ---- layers -----------------------------------------------------------------------------------

  /// Returns the layer of an AOV that has exactly one; its values are empty if the AOV is not
  /// stored. `samples`: sample count of each pixel.
  AovLayer layer(Aov aov, const std::vector<uint32_t>& samples) const;
  /// Returns a layer by name, which may be "light_NAME" or "lpe_NAME"; its name is empty if no such
  /// layer is stored. `multi_layer_names`: names of the stored light groups, then of the
  /// expressions.
  AovLayer layer(const std::string& name, const std::vector<uint32_t>& samples,
                 const std::vector<std::string>& multi_layer_names) const;
  /// Returns the layer of an AOV and frees its sums.
  AovLayer take(Aov aov, const std::vector<uint32_t>& samples);
  /// Returns all stored layers that were not taken. Each AOV's sums are freed as soon as its layer
  /// is complete. Layers of light groups are named "light_NAME", layers of expressions "lpe_NAME".
  std::vector<AovLayer> finish(const std::vector<uint32_t>& samples,
                               const std::vector<std::string>& multi_layer_names) &&;
  size_t bytes() const;
  /// Returns the deep image and frees its sums; empty if the render has no deep image.
  DeepLayer take_deep(const std::vector<uint32_t>& samples);
  /// Calls block(name, values) for each vector of sums, to write or read checkpoints. The sums of
  /// the deep image are not included; use DeepFilm::packed().
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
  /// Returns layer `which` of the AOV with all light groups, or of the AOV with all light path
  /// expressions.
  AovLayer multi_layer(Aov aov, uint32_t which, std::string name,
                       const std::vector<uint32_t>& samples) const;
  /// Calls layer(aov, which, name) for each stored light group and expression.
  template <typename Layer>
  void for_each_multi_layer(const std::vector<std::string>& multi_layer_names,
                            const Layer& layer) const;

  /// Returns the contribution of light splats to channel `c` of layer `sum_index` (kNotStored gives
  /// 0).
  double light_splat_mean(size_t pixel, uint32_t sum_index, size_t c) const {
    if (splats_.empty() || sum_index == LightSplatLayout::kNotStored) return 0;
    return light_splat_scale_.of(splats_.value(pixel * light_splat_layout_.count + sum_index, c));
  }

  AovLayout layout_;
  LightSplatLayout light_splat_layout_;
  size_t pixels_ = 0;
  // Pixel values of each AOV, indexed by aov_index(aov); empty if the AOV is not stored.
  std::array<std::vector<double>, kAovCount> sums_;
  std::array<std::vector<float>, kAovCount> nearest_;
  std::array<std::vector<CryptoPixel>, kCryptoLevels> crypto_;
  LightSplatSums splats_;  ///< index: pixel * light_splat_layout_.count + sum index; empty without
                           ///< light splats
  LightSplatScale light_splat_scale_;
  DeepFilm deep_;
  std::vector<uint32_t> hits_;  ///< number of samples per pixel that hit something
  std::vector<float> centre2_;  ///< squared distance of the nearest sample to the centre, pixels^2
};

/// Returns the ids in a Cryptomatte layer, sorted and without duplicates.
std::vector<uint32_t> crypto_ids(const AovLayer& pairs);

}  // namespace wavecomb
