// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/guiding/image_tiles.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "wavecomb/core/error.h"

namespace wavecomb {
namespace {

constexpr uint32_t kMostRows = 16, kPathsOfTile = 64;
/// Resolution of sums, and largest luminance that counts, both relative to the median.
constexpr double kStep = 0x1p-20, kMostOfMedian = 64;

}  // namespace

PictureTiles::PictureTiles(const Settings& settings, std::span<const uint32_t> pixels,
                           std::span<const float> luminance)
    : width_(settings.width), height_(settings.height) {
  while (rows_ < kMostRows && (rows_ + 1) * (rows_ + 1) * kPathsOfTile <= pixels.size()) ++rows_;
  std::vector<float> lit;
  for (const float y : luminance)
    if (std::isfinite(y) && y > 0) lit.push_back(y);
  if (lit.empty()) return;
  const auto middle = lit.begin() + static_cast<std::ptrdiff_t>(lit.size() / 2);
  std::nth_element(lit.begin(), middle, lit.end());
  const double unit{*middle};
  struct Tile {
    uint64_t sum = 0, count = 0;
  };
  std::vector<Tile> tiles(count());
  Tile all;
  for (size_t i = 0; i < pixels.size(); ++i) {
    const double y = luminance[i] > 0 ? double{luminance[i]} / unit : 0;  // 0 for NaN
    const auto steps = static_cast<uint64_t>(std::nearbyint(std::min(y, kMostOfMedian) / kStep));
    Tile& tile = tiles[of(pixels[i])];
    tile.sum += steps;
    ++tile.count;
    all.sum += steps;
    ++all.count;
  }
  const auto mean = [&](const Tile& t) {
    return t.count == 0 ? 0 : kStep * static_cast<double>(t.sum) / static_cast<double>(t.count);
  };
  // Regularized as relMSE is, since few paths can miss the light of a tile.
  const double least = 0.05 * mean(all) * mean(all);
  for (const Tile& tile : tiles) {
    const double m = mean(tile);
    inverse_.push_back(1 / (unit * std::sqrt(m * m + least)));
    table_.push_back(static_cast<float>(inverse_.back()));
  }
}

PictureTiles::PictureTiles(const Settings& settings, std::vector<double> inverse_scales)
    : width_(settings.width), height_(settings.height), inverse_(std::move(inverse_scales)) {
  while (rows_ < kMostRows && rows_ * rows_ < inverse_.size()) ++rows_;
  if (!inverse_.empty() && inverse_.size() != count())
    throw Error("the brightness of the picture that was learned before is damaged; start anew");
  for (const double scale : inverse_) table_.push_back(static_cast<float>(scale));
}

void PictureTiles::apply(GuideView& view) const {
  if (!is_lit()) return;
  view.tiles = table_.data();
  view.tile_rows = rows_;
  // Slightly less, so that rounding never leads beyond the last tile.
  view.tiles_of_x = static_cast<float>(rows_) / static_cast<float>(width_) * (1 - 0x1p-20f);
  view.tiles_of_y = static_cast<float>(rows_) / static_cast<float>(height_) * (1 - 0x1p-20f);
}

uint32_t PictureTiles::of(uint32_t pixel) const {
  const uint32_t x = (pixel & 0xffffu) * rows_ / width_;
  return x + (pixel >> 16) * rows_ / height_ * rows_;
}

}  // namespace wavecomb
