// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/guiding/image_tiles.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "wavecomb/core/error.h"
#include "wavecomb/core/settings.h"

namespace wavecomb {
namespace {

constexpr uint32_t kMaxRows = 16, kPathsOfTile = 64;
/// Step size of the integer sums, and upper limit of luminances, both relative to the median
/// luminance.
constexpr double kStep = 0x1p-20, kMaxOfMedian = 64;

}  // namespace

ImageTiles::ImageTiles(const Settings& settings, std::span<const uint32_t> pixels,
                       std::span<const float> luminance)
    : width_(settings.width), height_(settings.height) {
  while (rows_ < kMaxRows && (rows_ + 1) * (rows_ + 1) * kPathsOfTile <= pixels.size()) ++rows_;
  std::vector<float> nonzero;
  for (const float y : luminance)
    if (std::isfinite(y) && y > 0) nonzero.push_back(y);
  if (nonzero.empty()) return;
  const auto middle = nonzero.begin() + static_cast<std::ptrdiff_t>(nonzero.size() / 2);
  std::nth_element(nonzero.begin(), middle, nonzero.end());
  const double unit{*middle};
  struct Tile {
    uint64_t sum = 0, count = 0;
  };
  std::vector<Tile> tiles(count());
  Tile all;
  for (size_t i = 0; i < pixels.size(); ++i) {
    const double y = luminance[i] > 0 ? double{luminance[i]} / unit : 0;  // 0 for NaN
    const auto steps = static_cast<uint64_t>(std::nearbyint(std::min(y, kMaxOfMedian) / kStep));
    Tile& tile = tiles[of(pixels[i])];
    tile.sum += steps;
    ++tile.count;
    all.sum += steps;
    ++all.count;
  }
  const auto mean = [&](const Tile& t) {
    return t.count == 0 ? 0 : kStep * static_cast<double>(t.sum) / static_cast<double>(t.count);
  };
  // Regularise the division as in the relMSE metric, since the few paths of a tile may miss its
  // light.
  const double least = 0.05 * mean(all) * mean(all);
  for (const Tile& tile : tiles) {
    const double m = mean(tile);
    inverse_.push_back(1 / (unit * std::sqrt(m * m + least)));
    table_.push_back(static_cast<float>(inverse_.back()));
  }
}

ImageTiles::ImageTiles(const Settings& settings, std::vector<double> inverse_scales)
    : width_(settings.width), height_(settings.height), inverse_(std::move(inverse_scales)) {
  while (rows_ < kMaxRows && rows_ * rows_ < inverse_.size()) ++rows_;
  if (!inverse_.empty() && inverse_.size() != count())
    throw Error("the brightness of the picture that was learned before is damaged; start anew");
  for (const double scale : inverse_) table_.push_back(static_cast<float>(scale));
}

void ImageTiles::apply(GuidingView& view) const {
  if (!is_lit()) return;
  view.tiles = table_.data();
  view.tile_rows = rows_;
  // Use a slightly smaller factor, so that rounding never leads to an index beyond the last tile.
  view.tiles_of_x = static_cast<float>(rows_) / static_cast<float>(width_) * (1 - 0x1p-20f);
  view.tiles_of_y = static_cast<float>(rows_) / static_cast<float>(height_) * (1 - 0x1p-20f);
}

uint32_t ImageTiles::of(uint32_t pixel) const {
  const uint32_t x = (pixel & 0xffffu) * rows_ / width_;
  return x + (pixel >> 16) * rows_ / height_ * rows_;
}

}  // namespace wavecomb
