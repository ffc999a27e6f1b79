// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/texture/texture.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <new>

#include "wavecomb/core/error.h"
#include "wavecomb/texture/pyramid.h"
#include "wavecomb/texture/tile_store.h"

namespace wavecomb {

namespace {

constexpr std::align_val_t kAlignment{64};
/// 2^31 words, the range of a gather with signed 32-bit indices.
constexpr uint64_t kMaxBytes = uint64_t{1} << 33;
constexpr uint64_t kMaxTexels = uint64_t{1} << 32;  ///< range of 32-bit texel indices

using Color4 = std::array<float, 4>;

void check(const TextureDesc& desc) {
  const std::string where = "texture '" + desc.name + "': ";
  const std::string size = std::to_string(desc.width) + " x " + std::to_string(desc.height);
  if (desc.width == 0 || desc.height == 0) throw Error(where + "has no pixels (" + size + ")");
  if (desc.width > Texture::kMaxSize || desc.height > Texture::kMaxSize) {
    throw Error(where + "is " + size + "; the largest side is " +
                std::to_string(Texture::kMaxSize) + "; make it smaller");
  }
  if (desc.channels < 1 || desc.channels > 4) {
    throw Error(where + "has " + std::to_string(desc.channels) + " channels; 1 to 4 can be read");
  }
  if (value_bytes(desc.format) == 0) throw Error(where + "has an unknown format");
  if (!desc.data) throw Error(where + "has no data");
}

/// Returns bounds of texture lookup results, given the range of the texel values.
///
/// A filter interpolates a + (b - a) t up to three times with t in [0, 1]. If all texels are equal,
/// the interpolation is exact; otherwise each step adds at most two rounding errors. Rounding does
/// not change the sign of a result: for a and b >= 0, the rounded b - a is at least -a, and
/// therefore its product with t is at least -a as well.
TexelRange filtered(const TexelRange& texels) {
  constexpr float kRoundings = 1e-6f;
  TexelRange range = texels;
  for (size_t c = 0; c < 4; ++c) {
    float &low = range.low[c], &high = range.high[c];
    if (low == high) continue;
    const float more = kRoundings * std::max(std::abs(low), std::abs(high));
    low = low >= 0 ? std::max(low - more, 0.f) : low - more;
    high = high <= 0 ? std::min(high + more, 0.f) : high + more;
  }
  return range;
}

/// Returns bounds of the lookup results of a texture, from the statistics of its mip pyramid.
TexelRange range_of(const TextureView& view, const PyramidTotals& totals) {
  TexelRange range{{0, 0, 0, 1}, {0, 0, 0, 1}};
  for (size_t c = 0; c < view.channels; ++c) {
    range.low[c] = totals.low[c];
    range.high[c] = totals.high[c];
  }
  for (size_t c = 1; c < 3 && view.channels == 1; ++c) {
    range.low[c] = range.low[0];
    range.high[c] = range.high[0];
  }
  if (!view.has_alpha) range.low[3] = range.high[3] = 1;
  const float alpha = view.has_alpha ? 0.f : 1.f;
  if (view.wrap_s == Wrap::kBlack || view.wrap_t == Wrap::kBlack)
    range.add({{0, 0, 0, alpha}, {0, 0, 0, alpha}});
  return filtered(range);
}

}  // namespace

void TexelRange::add(const TexelRange& other) {
  for (size_t c = 0; c < 4; ++c) {
    low[c] = std::min(low[c], other.low[c]);
    high[c] = std::max(high[c], other.high[c]);
  }
}

uint64_t lay_out(const TextureDesc& desc, TextureView& view) {
  constexpr uint32_t kTile = TextureView::kTile;
  uint64_t texels = 0;
  uint32_t width = desc.width, height = desc.height;
  for (uint32_t& n = view.level_count; n < TextureView::kMaxLevels;) {
    const uint32_t tiles_x = (width + kTile - 1) / kTile, tiles_y = (height + kTile - 1) / kTile;
    // The offset may overflow for images that are too large, but then the size check throws Error.
    view.levels[n++] = {width, height, tiles_x, static_cast<uint32_t>(texels)};
    texels += uint64_t{tiles_x} * tiles_y * kTile * kTile;
    if (width == 1 && height == 1) break;
    width = std::max(1u, width / 2);
    height = std::max(1u, height / 2);
  }
  const uint64_t bytes = texels * view.channels * value_bytes(view.format);
  const std::string where = "texture '" + desc.name + "': its mip levels ";
  if (bytes >= kMaxBytes) {
    throw Error(where + "take " + std::to_string(bytes >> 30) +
                " GiB; 8 GiB is the most; make it smaller");
  }
  if (texels > kMaxTexels) {
    throw Error(where + "hold " + std::to_string(texels / 1000000) + " million texels; " +
                std::to_string(kMaxTexels / 1000000) + " million is the most; make it smaller");
  }
  return bytes;
}

void Texture::Free::operator()(const std::byte* p) const {
  if (store)
    store->remove(p);
  else
    ::operator delete[](const_cast<std::byte*>(p), kAlignment);
}

Texture::Texture(const TextureDesc& desc, const ForEach& for_each, std::shared_ptr<TileStore> store)
    : name_(desc.name), storage_(nullptr, Free{}) {
  check(desc);
  view_.format = desc.format;
  view_.channels = desc.channels == 1 ? 1 : 4;
  view_.srgb = desc.srgb && desc.format == TexelFormat::kU8;
  view_.has_alpha = desc.channels % 2 == 0;
  view_.wrap_s = desc.wrap_s;
  view_.wrap_t = desc.wrap_t;

  const uint64_t total = lay_out(desc, view_);
  bytes_ = static_cast<size_t>(total);
  if (store) {
    const uint64_t pixels = uint64_t{desc.width} * desc.height;
    store->expect(total, pixels * desc.channels * value_bytes(desc.format));
  }
  auto* levels = static_cast<std::byte*>(::operator new[](bytes_, kAlignment));
  storage_ = Storage(levels, Free{});
  const PyramidTotals totals = build_pyramid(desc, view_, levels, for_each);
  if (store) storage_ = Storage(store->add(levels, bytes_), Free{store});
  view_.texels = storage_.get();
  nonfinite_count_ = totals.nonfinite;
  const double count = double(desc.width) * double(desc.height);
  for (uint32_t c = 0; c < view_.channels; ++c)
    mean_[c] = static_cast<float>(totals.sum[c] / count);
  if (view_.channels == 1) mean_[1] = mean_[2] = mean_[0];
  range_ = range_of(view_, totals);
}

namespace {

TextureDesc one_texel(std::string name, const std::array<float, 4>& color) {
  TextureDesc desc;
  desc.name = std::move(name);
  desc.data = color.data();
  desc.width = desc.height = 1;
  desc.channels = 4;
  desc.format = TexelFormat::kF32;
  desc.wrap_s = desc.wrap_t = Wrap::kClamp;
  return desc;
}

}  // namespace

Texture::Texture(std::string name,
                 const std::vector<std::pair<uint32_t, std::shared_ptr<const Texture>>>& tiles,
                 const std::array<float, 4>& missing)
    : Texture(one_texel(std::move(name), missing)) {
  const std::string where = "texture '" + name_ + "': ";
  if (tiles.empty()) throw Error(where + "has no tiles");
  tiles_ = tiles;
  tile_set_ = std::make_unique<TileSet>();
  std::array<float, 4> sum{};
  for (const auto& [number, tile] : tiles_) {
    const uint32_t i = number - 1001u;
    if (i >= TileSet::kCount)
      throw Error(where + "tile " + std::to_string(number) + " is not one of 1001 to 1100");
    if (tile_set_->views[i]) throw Error(where + "has tile " + std::to_string(number) + " twice");
    if (!tile || tile->view().tiles)
      throw Error(where + "tile " + std::to_string(number) + " is not a plain texture");
    tile_set_->views[i] = &tile->view();
    for (size_t c = 0; c < 4; ++c) sum[c] += tile->mean()[c];
    range_.add(tile->range());
  }
  for (size_t c = 0; c < 4; ++c) mean_[c] = sum[c] / static_cast<float>(tiles_.size());
  view_.tiles = tile_set_.get();
}

size_t Texture::spanned_bytes() const {
  size_t sum = bytes_;
  for (const auto& [number, tile] : tiles_) sum += tile->bytes();
  return sum;
}

void in_order(size_t n, const std::function<void(size_t)>& body) {
  for (size_t i = 0; i < n; ++i) body(i);
}

std::array<float, 4> texel_at(const TextureView& view, uint32_t level, uint32_t x, uint32_t y) {
  const size_t bytes = value_bytes(view.format);
  const auto* p = static_cast<const std::byte*>(view.texels) +
                  texel_index(view.levels[level], x, y) * view.channels * bytes;
  Color4 c{0, 0, 0, 1};
  for (uint32_t i = 0; i < view.channels; ++i) {
    c[i] = decode_value(p + i * bytes, view.format, view.srgb && i < 3);
  }
  if (view.channels == 1) c[1] = c[2] = c[0];
  if (!view.has_alpha) c[3] = 1;
  return c;
}

}  // namespace wavecomb
