// SPDX-License-Identifier: Apache-2.0
/// How light that arrives at a point of the film counts for the pixels around it.
#pragma once

#include <algorithm>
#include <cmath>

#include "wavecomb/film/film.h"
#include "wavecomb/film/filter.h"

namespace wavecomb {

/// Light that arrives at (x, y), in pixels from the picture's upper left corner, counts for each
/// pixel by the filter's density at the way from its centre: as often as samples of that pixel,
/// which all count alike, would lie there.
class SplatFilter {
 public:
  /// `rendered`: pixels that get any.
  SplatFilter(const FilterTable& filter, const Region& rendered)
      : filter_(filter), rendered_(rendered) {}

  /// Whether any pixel gets light of (x, y).
  template <typename F>
  Mask<F> reaches(const F& x, const F& y) const {
    const float r = filter_.radius();
    const auto low = [&](uint32_t edge) { return F(static_cast<float>(edge) + 0.5f - r); };
    const auto high = [&](uint32_t edge) { return F(static_cast<float>(edge) - 0.5f + r); };
    return (x >= low(rendered_.x0)) & (x < high(rendered_.x1)) & (y >= low(rendered_.y0)) &
           (y < high(rendered_.y1));
  }

  /// Runs add(pixel, weight) for each pixel (Film::index) that light at (x, y) counts for.
  template <typename Add>
  void spread(const Film& film, float x, float y, const Add& add) const {
    const float r = filter_.radius();
    // Pixels i with |x - (i + 1/2)| < r.
    const auto first = [&](float at, uint32_t edge) {
      return std::max(static_cast<int>(std::floor(at - r - 0.5f)), static_cast<int>(edge));
    };
    const auto last = [&](float at, uint32_t edge) {
      return std::min(static_cast<int>(std::ceil(at + r - 0.5f)), static_cast<int>(edge) - 1);
    };
    const int x1 = last(x, rendered_.x1), y1 = last(y, rendered_.y1);
    for (int j = first(y, rendered_.y0); j <= y1; ++j) {
      const float row = filter_.density(y - (static_cast<float>(j) + 0.5f));
      if (!(row > 0)) continue;
      for (int i = first(x, rendered_.x0); i <= x1; ++i) {
        const float weight = row * filter_.density(x - (static_cast<float>(i) + 0.5f));
        if (weight > 0) add(film.index(static_cast<uint32_t>(i), static_cast<uint32_t>(j)), weight);
      }
    }
  }

 private:
  const FilterTable& filter_;
  Region rendered_;
};

}  // namespace wavecomb
