// SPDX-License-Identifier: Apache-2.0
/// What a film keeps beside the beauty: only what is asked for takes room.
#pragma once

#include <array>
#include <cstdint>
#include <limits>
#include <string>
#include <vector>

#include "wavecomb/core/aov.h"
#include "wavecomb/film/cryptomatte.h"

namespace wavecomb {

/// Material, instance or object where nothing was hit.
inline constexpr uint32_t kNothingHit = 0xffffffffu;

/// What a camera ray met first.
struct AovHit {
  float position[3] = {0, 0, 0};
  uint32_t object = kNothingHit;  ///< as ObjectNames numbers them
  uint32_t material = kNothingHit;
  uint32_t instance = kNothingHit;
  uint32_t pad[2] = {0, 0};
};

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

  /// Sums over samples of what was hit first.
  struct First {
    double albedo[3] = {0, 0, 0};
    double normal[3] = {0, 0, 0};
    double depth = 0;  ///< over samples that hit something
    uint32_t depth_samples = 0;
  };
  /// Of the sample nearest the pixel's centre, the first among equals.
  struct Nearest {
    float centre2 = std::numeric_limits<float>::infinity();  ///< squared distance, pixels
    float position[3] = {0, 0, 0};
    float uv[2] = {0, 0};
    uint32_t material = kNothingHit, instance = kNothingHit;
  };
  /// Sums of radiance: seen by the camera itself, after one scattering, and after more.
  struct Parts {
    double emission[3] = {0, 0, 0}, direct[3] = {0, 0, 0}, indirect[3] = {0, 0, 0};
  };
  /// Sums over samples of what guides a denoiser: albedo and normal.
  struct Guides {
    double albedo[3] = {0, 0, 0}, normal[3] = {0, 0, 0};
  };
  static constexpr uint32_t kCryptoLevels = 3;
  /// Ids given for each pixel, of those that CryptoPixel holds: three layers of a file.
  static constexpr uint32_t kCryptoRanks = 6;

  const AovLayout& layout() const { return layout_; }
  bool has_first() const { return !first_.empty(); }
  First& first(size_t pixel) { return first_[pixel]; }
  const Nearest& nearest(size_t pixel) const { return nearest_[pixel]; }
  /// Sums of rgb of light group 0, 1 ... of the layout, side by side.
  double* groups(size_t pixel) { return groups_.data() + pixel * 3 * layout_.light_groups; }

  /// One sample's first hit. `tables` is read for Cryptomatte only.
  void add_hit(size_t pixel, const AovHit& hit, float centre2, const float* uv,
               const CryptoTables* tables) {
    if (!nearest_.empty() && centre2 < nearest_[pixel].centre2) {
      nearest_[pixel] = {centre2,
                         {hit.position[0], hit.position[1], hit.position[2]},
                         {uv[0], uv[1]},
                         hit.material,
                         hit.instance};
    }
    if (hit.object != kNothingHit) {
      if (!crypto_[0].empty()) crypto_[0][pixel].add(tables->object_id[hit.object]);
      if (!crypto_[2].empty()) crypto_[2][pixel].add(tables->asset_id[hit.object]);
    }
    if (hit.material != kNothingHit && !crypto_[1].empty())
      crypto_[1][pixel].add(tables->material_id[hit.material]);
  }
  /// One sample's radiance (rgb) before the first scattering, with what came after one, and whole.
  void add_parts(size_t pixel, const float* emitted, const float* with_direct, const float* all) {
    Parts& p = parts_[pixel];
    for (size_t c = 0; c < 3; ++c) {
      p.emission[c] += double{emitted[c]};
      p.direct[c] += double{with_direct[c]} - double{emitted[c]};
      p.indirect[c] += double{all[c]} - double{with_direct[c]};
    }
  }
  /// One sample's albedo and normal, side by side.
  void add_guides(size_t pixel, const float* guides) {
    Guides& g = guides_[pixel];
    for (size_t c = 0; c < 3; ++c) {
      g.albedo[c] += double{guides[c]};
      g.normal[c] += double{guides[3 + c]};
    }
  }
  void add_cost(size_t pixel, double ns) { cost_ns_[pixel] += ns; }

  /// Means, where pixel i has count(i) samples; empty where not asked for.
  template <typename Count>
  std::vector<float> albedo(const Count& count) const {
    return layout_.set.has(Aov::kAlbedo) ? means(&First::albedo, count) : std::vector<float>{};
  }
  template <typename Count>
  std::vector<float> normal(const Count& count) const {
    return layout_.set.has(Aov::kNormal) ? means(&First::normal, count) : std::vector<float>{};
  }
  /// Means over the samples that hit something; infinite where none did.
  std::vector<float> depth() const;
  /// A layer that the set asks for, "light_NAME" among them; no name where it does not.
  AovLayer layer(const std::string& name, const std::vector<uint32_t>& samples,
                 const std::vector<std::string>& group_names) const;
  /// The layers that the set asks for beyond albedo, normal and depth, and the end of the film:
  /// sums are freed as soon as they were used. Light groups are called "light_" and their name.
  /// `samples` is by pixel.
  std::vector<AovLayer> finish(const std::vector<uint32_t>& samples,
                               const std::vector<std::string>& group_names) &&;
  size_t bytes() const;
  /// Runs block(name, values) for each vector of sums, for checkpoints.
  template <typename Block>
  void for_each_block(const Block& block) {
    block("aov_first", first_);
    block("aov_nearest", nearest_);
    block("aov_crypto_object", crypto_[0]);
    block("aov_crypto_material", crypto_[1]);
    block("aov_crypto_asset", crypto_[2]);
    block("aov_parts", parts_);
    block("aov_light_groups", groups_);
    block("aov_cost", cost_ns_);
    block("aov_guides", guides_);
  }

 private:
  static uint32_t level_index(Aov level) {
    return level == Aov::kCryptoObject ? 0 : level == Aov::kCryptoMaterial ? 1 : 2;
  }
  AovLayer crypto_layer(Aov level, const std::vector<uint32_t>& samples) const;
  /// One of the set beyond albedo, normal, depth and light groups.
  AovLayer layer(Aov aov, const std::vector<uint32_t>& samples) const;
  AovLayer group_layer(uint32_t group, const std::string& name,
                       const std::vector<uint32_t>& samples) const;
  template <typename Count>
  std::vector<float> means(double (First::*sum)[3], const Count& count) const {
    std::vector<float> out(3 * first_.size());
    for (size_t i = 0; i < first_.size(); ++i)
      for (size_t c = 0; c < 3; ++c)
        out[3 * i + c] =
            static_cast<float>((first_[i].*sum)[c] * (count(i) == 0 ? 0.0 : 1.0 / count(i)));
    return out;
  }

  AovLayout layout_;
  size_t pixels_ = 0;
  std::vector<First> first_;
  std::vector<Nearest> nearest_;
  std::array<std::vector<CryptoPixel>, kCryptoLevels> crypto_;
  std::vector<Parts> parts_;
  std::vector<double> groups_;
  std::vector<double> cost_ns_;
  std::vector<Guides> guides_;
};

/// Sorted ids in a Cryptomatte's layer.
std::vector<uint32_t> crypto_ids(const AovLayer& pairs);

}  // namespace wavecomb
