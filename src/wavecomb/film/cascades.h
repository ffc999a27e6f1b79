// SPDX-License-Identifier: Apache-2.0
/// Samples of a pixel by brightness, and how far those much brighter than others are to be trusted.
///
/// T. Zirr, J. Hanika, C. Dachsbacher, "Re-weighting firefly samples for improved finite-sample
/// Monte Carlo estimates", Computer Graphics Forum 37(6), 2018. Layer i is for samples of about the
/// brightness B_i = B_0 b^i; one of luminance y between B_i and B_{i+1} is split between the two,
///   w = (B_i / y - 1 / b) / (1 - 1 / b) to layer i,   1 - w to layer i + 1,
/// so that layers change gently with y. With S_i the sum of a layer over the pixel's n samples,
///   c_i = y(S_{i-1}) / B_{i-1} + y(S_i) / B_i + y(S_{i+1}) / B_{i+1}
/// counts the samples that are about as bright, and C_i is the mean of that over the 3 x 3 pixels
/// around. A layer is kept as far as it has enough of them, or as one sample of it changes little:
///   r_i = max(((C_i < 1 ? C_i : c_i) - 1) / kappa,   n I_i / (tau B_i)),   clamped to [0, 1],
/// I_i the mean brightness of what is below layer i in the 3 x 3 pixels. What is taken away,
///   sum_i (1 - r_i) S_i / n,
/// goes to 0 as n grows. The first layer is always kept.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "wavecomb/core/settings.h"

namespace wavecomb {

/// Contract: as Film's: a pixel is written by one thread at a time, its samples in sample order.
class Cascades {
 public:
  static constexpr uint32_t kLayers = 8;
  static constexpr float kBase = 8;       ///< b
  static constexpr float kEnough = 2;     ///< kappa
  static constexpr float kTolerance = 8;  ///< tau

  Cascades() = default;
  /// Of the pixels of `window`. `darkest`: B_0.
  Cascades(const Region& window, float darkest);

  bool empty() const { return sums_.empty(); }
  /// Adds a sample of pixel `pixel` (Film::index).
  void add(size_t pixel, const float* rgb);
  /// What reweighting takes from the pixels' means, rgb interleaved; empty where nothing is kept.
  /// `samples`: by pixel.
  std::vector<float> excess(const std::vector<uint32_t>& samples) const;
  size_t bytes() const { return sums_.size() * sizeof(Sum); }
  /// Runs block(name, values) for the sums, for checkpoints.
  template <typename Block>
  void for_each_block(const Block& block) {
    block("cascades", sums_);
  }

 private:
  using Layer = std::array<float, 3>;
  using Sum = std::array<Layer, kLayers>;
  /// Luminances of a pixel's layers, or sums of several pixels'.
  using Levels = std::array<float, kLayers>;

  float share_kept(const Levels& own, const Levels& around, float pixels, float samples,
                   float samples_around, uint32_t layer) const;

  uint32_t width_ = 0, height_ = 0;
  Levels brightness_{};  ///< B_i
  std::vector<Sum> sums_;
};

}  // namespace wavecomb
