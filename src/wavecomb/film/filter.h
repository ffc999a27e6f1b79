// SPDX-License-Identifier: Apache-2.0
/// Importance sampling of the pixel filter.
#pragma once

#include <vector>

#include "wavecomb/core/settings_choices.h"

namespace wavecomb {

/// Table of the inverse cumulative distribution of a separable, non-negative pixel filter along one
/// axis. With filter importance sampling, every sample has weight 1 and belongs to one pixel
/// (Ernst, Stamminger and Greiner, "Filter Importance Sampling", RT 2006).
class FilterTable {
 public:
  static constexpr uint32_t kBins = 1024;

  /// Tabulates a filter whose full width is `width` pixels. The Gaussian has sigma = width / 6. The
  /// Blackman-Harris filter is the 4-term window.
  FilterTable(FilterKind kind, float width);

  /// Returns the table of the inverse cumulative distribution with `kBins` + 2 offsets in pixels.
  /// Entry i is the offset for the sample value u = i / kBins. The last offset is stored twice.
  const float* offsets() const { return offsets_.data(); }

  /// Returns half of the filter's full width in pixels.
  float radius() const { return radius_; }
  /// Returns the probability density of sampled offsets at `x` pixels from the pixel centre. A
  /// light splat at this offset from the pixel centre has this weight.
  float density(float x) const {
    const float at = (x + radius_) * density_scale_;
    return at >= 0 && at < float{kBins} ? density_[static_cast<size_t>(at)] : 0.f;
  }

 private:
  std::vector<float> offsets_;
  float radius_, density_scale_;
  /// Probability density of sampled offsets, as the mean in each of `kBins` equal bins of the
  /// filter's width.
  std::vector<float> density_;
};

}  // namespace wavecomb
