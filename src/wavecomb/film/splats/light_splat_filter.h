// SPDX-License-Identifier: Apache-2.0
/// Pixel filter for light splats.
#pragma once

#include <algorithm>
#include <cmath>

#include "wavecomb/core/encoding/hash.h"
#include "wavecomb/core/lanes/arithmetic.h"
#include "wavecomb/film/film.h"
#include "wavecomb/film/filter.h"

namespace wavecomb {

/// Wrap-around of a panoramic image. Points repeat after a full turn in x. A point beyond a pole is
/// mirrored in y at the pole and moved by half a turn in x. If `pixels` is 0, the image does not
/// wrap around.
struct ImageWrap {
  float pixels = 0;            ///< width of a full turn in pixels
  float north = 0, south = 0;  ///< y coordinates of the poles in pixels
};

/// Position (x, y) of a light splat, in pixels from the upper left corner of the image, and random
/// bits of its path vertex.
struct LightSplatPoint {
  float x, y;
  uint32_t bits;
};

/// Distributes light splats over pixels with the pixel filter. The splat's weight in a pixel is the
/// density of the filter at its offset from the pixel centre, which is also the density with which
/// filter importance sampling chooses the positions of the pixel's camera rays. In mode
/// `one_pixel`, a splat contributes to a single pixel with the sum of its weights in all pixels.
/// The pixel is chosen with a probability proportional to the splat's weight in the pixel. The
/// choice does not depend on the rendered region.
class LightSplatFilter {
 public:
  /// Creates a filter for light splats. `rendered` is the rectangle of pixels that receive light
  /// splats.
  LightSplatFilter(const FilterTable& filter, const Region& rendered, const ImageWrap& turn = {},
                   bool one_pixel = false)
      : filter_(filter), rendered_(rendered), turn_(turn), one_pixel_(one_pixel) {}

  /// Returns whether a splat at (x, y) contributes to any pixel.
  template <typename F>
  Mask<F> reaches(const F& x, const F& y) const {
    if (turn_.pixels == 0) [[likely]]
      return (x >= left()) & (x < right()) & contains_row<F>(y);
    const F half = x + 0.5f * turn_.pixels;
    return (contains_row<F>(y) & wraps_into_image<F>(x)) |
           ((contains_row<F>(F(2 * turn_.north - y)) | contains_row<F>(F(2 * turn_.south - y))) &
            wraps_into_image<F>(half));
  }

  /// Calls `add(pixel, weight)` for each pixel to which a splat contributes. `pixel` is the result
  /// of `Film::index`.
  template <typename Add>
  void spread(const Film& film, const LightSplatPoint& at, const Add& add) const {
    if (turn_.pixels == 0) [[likely]] {
      spread_at(film, at, add);
      return;
    }
    const float half = at.x + 0.5f * turn_.pixels;
    spread_around(film, at, add);
    spread_around(film, {half, 2 * turn_.north - at.y, at.bits}, add);
    spread_around(film, {half, 2 * turn_.south - at.y, at.bits}, add);
  }

 private:
  // Bounds of the splat positions whose filter footprint overlaps a rendered pixel.
  float left() const { return low(rendered_.x0); }
  float right() const { return high(rendered_.x1); }
  float low(uint32_t edge) const { return static_cast<float>(edge) + 0.5f - filter_.radius(); }
  float high(uint32_t edge) const { return static_cast<float>(edge) - 0.5f + filter_.radius(); }
  template <typename F>
  Mask<F> contains_row(const F& y) const {
    return (y >= low(rendered_.y0)) & (y < high(rendered_.y1));
  }
  /// Shifts `x` by whole turns of the panorama, so that it lies between `left()` and `left()` plus
  /// one turn.
  template <typename F>
  F after_left(const F& x) const {
    return x - floor(F(F(x - left()) * (1.f / turn_.pixels))) * turn_.pixels;
  }
  /// Returns whether the filter footprint of a position, shifted by whole turns of the panorama,
  /// overlaps a rendered column.
  template <typename F>
  Mask<F> wraps_into_image(const F& x) const {
    return after_left<F>(x) < right();
  }

  template <typename Add>
  void spread_around(const Film& film, const LightSplatPoint& at, const Add& add) const {
    if (!contains_row<float>(at.y)) return;
    for (float x = after_left<float>(at.x); x < right(); x += turn_.pixels)
      spread_at(film, {x, at.y, at.bits}, add);
  }

  /// Selected pixel column or row, and the sum of the weights of all columns or rows.
  struct Chosen {
    int index;
    float weight;
  };
  /// Chooses a column or row for a splat at `at`, with a probability proportional to its weight.
  /// `u` is uniform in [0, 1).
  Chosen choose(float at, float u) const {
    const float r = filter_.radius();
    const int first = static_cast<int>(std::floor(at - r - 0.5f));
    const int last = static_cast<int>(std::ceil(at + r - 0.5f));
    const auto weight = [&](int i) {
      return std::max(0.f, filter_.density(at - (static_cast<float>(i) + 0.5f)));
    };
    float sum = 0;
    for (int i = first; i <= last; ++i) sum += weight(i);
    Chosen chosen{first, sum};
    float left = u * sum;
    for (int i = first; i <= last; ++i) {
      const float w = weight(i);
      if (!(w > 0)) continue;
      chosen.index = i;
      if (left < w) break;
      left -= w;
    }
    return chosen;
  }
  template <typename Add>
  void add_to_one(const Film& film, const LightSplatPoint& at, const Add& add) const {
    const Chosen x = choose(at.x, unit_float<float>(hash_u32<uint32_t>(at.bits ^ 0x68bc21ebu)));
    const Chosen y = choose(at.y, unit_float<float>(hash_u32<uint32_t>(at.bits ^ 0x02e5be93u)));
    if (x.index < 0 || y.index < 0 || !(x.weight * y.weight > 0)) return;
    const auto column = static_cast<uint32_t>(x.index), row = static_cast<uint32_t>(y.index);
    if (rendered_.contains(column, row)) add(film.index(column, row), x.weight * y.weight);
  }

  template <typename Add>
  void spread_at(const Film& film, const LightSplatPoint& point, const Add& add) const {
    if (one_pixel_) {
      add_to_one(film, point, add);
      return;
    }
    const auto [x, y, bits] = point;
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

  const FilterTable& filter_;
  Region rendered_;
  ImageWrap turn_;
  bool one_pixel_;
};

}  // namespace wavecomb
