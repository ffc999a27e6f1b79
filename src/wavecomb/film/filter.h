// SPDX-License-Identifier: Apache-2.0
/// Importance sampling of the pixel filter.
#pragma once

#include <vector>

#include "wavecomb/core/settings.h"

namespace wavecomb {

/// Inverse cumulative distribution of a separable, non-negative pixel filter along one axis.
/// Sampling the filter gives every sample weight 1 and assigns it to one pixel (Ernst, Stamminger
/// and Greiner, "Filter Importance Sampling", RT 2006).
class FilterTable {
 public:
  static constexpr uint32_t kBins = 1024;

  /// Tabulates a filter of full width `width` pixels. The Gaussian has sigma = width / 6;
  /// Blackman-Harris is the 4-term window.
  FilterTable(FilterKind kind, float width);

  /// Returns the inverse cumulative distribution: kBins + 2 offsets in pixels, where entry i
  /// belongs to the sample value u = i / kBins. The last offset is stored twice.
  const float* offsets() const { return offsets_.data(); }

  /// Returns half of the filter's full width in pixels.
  float radius() const { return radius_; }
  /// Returns the density per pixel of the sampled offsets at `x` pixels from the pixel centre. This
  /// density is the filter weight of light that arrives at this offset.
  float density(float x) const {
    const float at = (x + radius_) * density_scale_;
    return at >= 0 && at < float{kBins} ? density_[static_cast<size_t>(at)] : 0.f;
  }

 private:
  std::vector<float> offsets_;
  float radius_, density_scale_;
  /// Density of offsets_, averaged over kBins equal bins of the width.
  std::vector<float> density_;
};

}  // namespace wavecomb
