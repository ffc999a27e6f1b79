// SPDX-License-Identifier: Apache-2.0
/// Firefly reduction. Each pixel has a cascade of brightness layers, and layers with too few
/// samples get lower weights.
///
/// T. Zirr, J. Hanika, C. Dachsbacher, "Re-weighting firefly samples for improved finite-sample
/// Monte Carlo estimates", Computer Graphics Forum 37(6), 2018. Layer i holds samples with a
/// luminance near B_i = B_0 b^i. A sample of luminance y between B_i and B_{i+1} is split with
/// weights
///   w = (B_i / y - 1 / b) / (1 - 1 / b) for layer i,   1 - w for layer i + 1,
/// so that layers vary continuously with y. Let S_i be the sum of the pixel's n samples in layer i,
/// and y(S_i) its luminance. Then
///   c_i = y(S_{i-1}) / B_{i-1} + y(S_i) / B_i + y(S_{i+1}) / B_{i+1}
/// estimates the number of samples of similar brightness in the pixel. C_i is the mean of c_i over
/// the 3 x 3 neighbourhood of pixels. A layer is trusted if it has enough samples, or if one of its
/// samples changes the result little:
///   r_i = max((k_i - 1) / kappa,   n I_i / (tau B_i)),   clamped to [0, 1],
/// where k_i is C_i if C_i < 1 and c_i otherwise, and I_i is the mean brightness of all layers
/// below i in the 3 x 3 neighbourhood. The energy that firefly reduction removes,
///   sum_i (1 - r_i) S_i / n,
/// tends to 0 as n grows. The weight of layer 0 is always 1.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "wavecomb/core/settings_choices.h"

namespace wavecomb {

/// Brightness cascades of all pixels of a film's window.
///
/// Contract: at most one thread writes to a pixel at a time and adds its samples in sample order.
class Cascades {
 public:
  static constexpr uint32_t kLayers = 8;
  static constexpr float kBase = 8;       ///< b
  static constexpr float kEnough = 2;     ///< kappa
  static constexpr float kTolerance = 8;  ///< tau

  Cascades() = default;
  /// Creates empty cascades for the pixels of `window`. `darkest`: B_0, a luminance.
  Cascades(const Region& window, float darkest);

  bool empty() const { return sums_.empty(); }
  /// Adds a sample of the pixel with the index `pixel` (a result of `Film::index`).
  void add(size_t pixel, const float* rgb);
  /// Returns the RGB radiance, interleaved, that firefly reduction subtracts from the mean of each
  /// pixel. The result is empty if no cascades are stored. `samples` is the sample count of each
  /// pixel.
  std::vector<float> excess(const std::vector<uint32_t>& samples) const;
  size_t bytes() const { return sums_.size() * sizeof(Sum); }
  /// Calls `block(name, values)` with the sums of the cascades, to write or read checkpoints.
  template <typename Block>
  void for_each_block(const Block& block) {
    block("cascades", sums_);
  }

 private:
  using Layer = std::array<float, 3>;
  using Sum = std::array<Layer, kLayers>;
  /// Luminance of each layer, for one pixel or summed over several pixels.
  using Levels = std::array<float, kLayers>;

  /// Returns the weight r_i of the layer `layer`. `own` contains the layers of the pixel. `around`
  /// contains the sums of the layers over the pixel's neighbourhood, which has `pixels` pixels with
  /// `samples_around` samples in total.
  float kept_fraction(const Levels& own, const Levels& around, float pixels, float samples,
                      float samples_around, uint32_t layer) const;

  uint32_t width_ = 0, height_ = 0;
  Levels brightness_{};  ///< B_i
  std::vector<Sum> sums_;
};

}  // namespace wavecomb
