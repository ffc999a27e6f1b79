// SPDX-License-Identifier: Apache-2.0
/// The pixel filter, as offsets to sample.
#pragma once

#include <vector>

#include "wavecomb/core/settings.h"

namespace wavecomb {

/// Inverse cumulative distribution of a separable, non-negative pixel filter along one axis:
/// importance sampled, so that every sample has weight 1 and belongs to one pixel (Ernst,
/// Stamminger and Greiner, "Filter Importance Sampling", RT 2006).
class FilterTable {
 public:
  static constexpr uint32_t kBins = 1024;

  /// `width`: full width in pixels. Gaussian: sigma = width / 6. Blackman-Harris: 4-term window.
  FilterTable(FilterKind kind, float width);

  /// kBins + 2 offsets in pixels; entry i belongs to u = i / kBins.
  const float* offsets() const { return offsets_.data(); }

  /// Half the filter's full width, pixels.
  float radius() const { return radius_; }
  /// Density of the offsets at `x` pixels from the pixel's centre, per pixel: what light that
  /// arrives there counts for the pixel.
  float density(float x) const {
    const float at = (x + radius_) * density_scale_;
    return at >= 0 && at < float{kBins} ? density_[static_cast<size_t>(at)] : 0.f;
  }

 private:
  std::vector<float> offsets_;
  float radius_, density_scale_;
  std::vector<float> density_;  ///< of offsets_, means over kBins equal parts of the width
};

}  // namespace wavecomb
