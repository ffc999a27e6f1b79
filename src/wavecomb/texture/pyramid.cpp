// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/texture/pyramid.h"

#include <algorithm>
#include <cstring>
#include <vector>

#include "wavecomb/texture/half.h"
#include "wavecomb/texture/row_range.h"
#include "wavecomb/texture/srgb.h"

namespace wavecomb {
namespace {

constexpr uint32_t kTile = TextureView::kTile;
/// Maximum number of mip levels that one task computes from a band of rows while the rows are in
/// the cache.
constexpr uint32_t kBandLevels = 6;

/// Box filter of one destination texel along one axis: index of the first source texel, and the
/// weights of the source texels that the destination texel covers. The weights are proportional to
/// the covered fractions and sum to 1.
struct Box {
  uint32_t first;
  std::vector<float> weights;
};
std::vector<Box> make_boxes(uint32_t size, uint32_t n) {
  std::vector<Box> boxes(n);
  for (uint64_t i = 0; i < n; ++i) {
    // Integers in units of 1 / n source texels make this computation exact.
    const uint64_t begin = i * size, end = begin + size;
    boxes[i].first = static_cast<uint32_t>(begin / n);
    for (uint64_t j = begin / n; j * n < end; ++j) {
      const uint64_t covered = std::min(end, (j + 1) * n) - std::max(begin, j * n);
      boxes[i].weights.push_back(static_cast<float>(covered) / static_cast<float>(size));
    }
  }
  return boxes;
}

/// Filters a row of texels with `columns`, multiplies the result by `weight`, and adds it to `to`.
void add_row(const std::vector<Box>& columns, uint32_t channels, float weight, const float* from,
             float* to) {
  for (size_t x = 0; x < columns.size(); ++x) {
    const Box& box = columns[x];
    const float* p = from + size_t{box.first} * channels;
    for (uint32_t c = 0; c < channels; ++c) {
      float sum = 0;
      for (size_t i = 0; i < box.weights.size(); ++i) sum += box.weights[i] * p[i * channels + c];
      to[x * channels + c] += weight * sum;
    }
  }
}

/// Averages blocks of 2 x 2 texels of the rows `a` and `b`, and writes `n` texels to `to`.
template <uint32_t C>
void average_rows(const float* a, const float* b, size_t n, float* to) {
  for (size_t x = 0; x < n; ++x)
    for (uint32_t c = 0; c < C; ++c) {
      const float upper = 0.5f * a[2 * x * C + c] + 0.5f * a[2 * x * C + C + c];
      const float lower = 0.5f * b[2 * x * C + c] + 0.5f * b[2 * x * C + C + c];
      // Adding 0 turns -0 into 0. In add_row(), this happens because sums start from 0.
      to[x * C + c] = 0.5f * upper + 0.5f * lower + 0.f;
    }
}

/// Builder of one texture's mip levels.
class Pyramid {
 public:
  Pyramid(const TextureDesc& desc, const TextureView& view, std::byte* storage)
      : desc_(desc), view_(view), storage_(storage), channels_(view.channels) {
    for (uint32_t n = 1; n < view.level_count; ++n)
      columns_.push_back(make_boxes(view.levels[n - 1].width, view.levels[n].width));
    // A band is the set of rows that one row of level `band_top_` covers, so the heights of all
    // finer levels must be even.
    while (band_top_ + 1 < view.level_count && band_top_ < kBandLevels &&
           view.levels[band_top_].height % 2 == 0)
      ++band_top_;
  }

  PyramidTotals build(const ForEach& for_each) {
    clear_margins();
    const uint32_t bands = view_.levels[band_top_].height;
    std::vector<PyramidTotals> totals(view_.levels[0].height);
    const bool more = band_top_ + 1 < view_.level_count;
    std::vector<float> image(more && band_top_ > 0 ? row_size(band_top_) * bands : 0);
    for_each(bands, [&](size_t band) {
      Scratch scratch(*this);
      float* out = image.empty() ? scratch.row(band_top_, 0) : &image[band * row_size(band_top_)];
      make_row(band_top_, static_cast<uint32_t>(band), out, scratch, totals);
    });
    for (uint32_t n = band_top_ + 1; n < view_.level_count; ++n) {
      std::vector<float> next(row_size(n) * view_.levels[n].height);
      shrink(n, image, next, for_each, totals);
      image.swap(next);
    }
    PyramidTotals total;
    for (const PyramidTotals& row : totals) {
      total.nonfinite += row.nonfinite;
      for (uint32_t c = 0; c < 4; ++c) {
        total.sum[c] += row.sum[c];
        total.low[c] = std::min(total.low[c], row.low[c]);
        total.high[c] = std::max(total.high[c], row.high[c]);
      }
    }
    return total;
  }

 private:
  /// Buffers for two rows of each level of a band.
  class Scratch {
   public:
    explicit Scratch(const Pyramid& p) {
      for (uint32_t n = 0; n <= p.band_top_; ++n) {
        first_.push_back(size_);
        size_ += 2 * p.row_size(n);
        widths_.push_back(p.row_size(n));
      }
      values_.resize(size_);
    }
    float* row(uint32_t level, uint32_t i) {
      return values_.data() + first_[level] + i * widths_[level];
    }

   private:
    size_t size_ = 0;
    std::vector<size_t> first_, widths_;
    std::vector<float> values_;
  };

  size_t row_size(uint32_t level) const { return size_t{view_.levels[level].width} * channels_; }

  /// Sets all levels that do not fill their edge tiles to 0, so that texels outside the image are
  /// 0.
  void clear_margins() {
    for (uint32_t n = 0; n < view_.level_count; ++n) {
      const TextureLevel& level = view_.levels[n];
      if (level.width % kTile == 0 && level.height % kTile == 0) continue;
      const size_t tiles = size_t{level.tiles_x} * ((level.height + kTile - 1) / kTile);
      const size_t bytes = size_t{channels_} * value_bytes(view_.format);
      std::memset(storage_ + size_t{level.offset} * bytes, 0, tiles * kTile * kTile * bytes);
    }
  }

  /// Computes row y of a level up to band_top_ recursively, and writes it to `out` and the storage.
  void make_row(uint32_t level, uint32_t y, float* out, Scratch& scratch,
                std::vector<PyramidTotals>& totals) {
    if (level == 0) {
      totals[y] = read_row(y, out);
      store_row(0, y, out, totals[y]);
      for (size_t i = 0; i < row_size(0); i += channels_)
        for (uint32_t c = 0; c < channels_; ++c) totals[y].sum[c] += double{out[i + c]};
      return;
    }
    float *a = scratch.row(level - 1, 0), *b = scratch.row(level - 1, 1);
    make_row(level - 1, 2 * y, a, scratch, totals);
    make_row(level - 1, 2 * y + 1, b, scratch, totals);
    const size_t width = view_.levels[level].width;
    if (view_.levels[level - 1].width != 2 * width) {
      std::fill(out, out + row_size(level), 0.f);
      add_row(columns_[level - 1], channels_, 0.5f, a, out);
      add_row(columns_[level - 1], channels_, 0.5f, b, out);
    } else if (channels_ == 1) {
      average_rows<1>(a, b, width, out);
    } else {
      average_rows<4>(a, b, width, out);
    }
    store_row(level, y, out, totals[size_t{y} << level]);
  }

  /// Computes level n from level n - 1, which is `image`, or from the caller's pixels if n is 1.
  void shrink(uint32_t n, std::vector<float>& image, std::vector<float>& next,
              const ForEach& for_each, std::vector<PyramidTotals>& totals) {
    const auto rows = make_boxes(view_.levels[n - 1].height, view_.levels[n].height);
    for_each(rows.size(), [&](size_t y) {
      float* to = &next[y * row_size(n)];
      std::vector<float> pixels(n == 1 ? row_size(0) : 0);
      for (uint32_t j = 0; j < rows[y].weights.size(); ++j) {
        const uint32_t from = rows[y].first + j;
        if (n == 1) read_row(from, pixels.data());
        const float* row = n == 1 ? pixels.data() : &image[from * row_size(n - 1)];
        add_row(columns_[n - 1], channels_, rows[y].weights[j], row, to);
      }
      store_row(n, static_cast<uint32_t>(y), to, totals[y]);
    });
  }

  // ---- reading the caller's pixels as linear floats with the stored channels ----

  PyramidTotals read_row(uint32_t y, float* out) const {
    switch (desc_.channels) {
      case 1:
        return read_format<1>(y, out);
      case 2:
        return read_format<2>(y, out);
      case 3:
        return read_format<3>(y, out);
      default:
        return read_format<4>(y, out);
    }
  }

  template <uint32_t N>
  PyramidTotals read_format(uint32_t y, float* out) const {
    switch (desc_.format) {
      case TexelFormat::kU8:
        return read_values<N, TexelFormat::kU8>(y, out);
      case TexelFormat::kF16:
        return read_values<N, TexelFormat::kF16>(y, out);
      default:
        return read_values<N, TexelFormat::kF32>(y, out);
    }
  }

  template <uint32_t N, TexelFormat Format>
  PyramidTotals read_values(uint32_t y, float* out) const {
    const size_t bytes = value_bytes(Format);
    const auto* p = static_cast<const std::byte*>(desc_.data) + size_t{y} * desc_.width * N * bytes;
    const bool srgb = view_.srgb;
    PyramidTotals totals;
    for (uint32_t x = 0; x < desc_.width; ++x) {
      float v[4] = {0, 0, 0, 1};
      for (uint32_t c = 0; c < N; ++c, p += bytes) {
        const bool is_alpha = N % 2 == 0 && c + 1 == N;
        v[c] = decode_value(p, Format, srgb && !is_alpha);
        if (Format == TexelFormat::kU8) continue;
        if (!is_finite(v[c])) {
          ++totals.nonfinite;
          v[c] = 0;
        }
        v[c] = std::clamp(v[c], -Texture::kMaxTexel, Texture::kMaxTexel);
      }
      if (N == 1) {
        out[x] = v[0];
      } else {
        const float texel[4] = {v[0], N == 2 ? v[0] : v[1], N == 2 ? v[0] : v[2],
                                N == 2 ? v[1] : v[3]};
        std::memcpy(out + size_t{x} * 4, texel, sizeof(texel));
      }
    }
    return totals;
  }

  // ---- writing the storage ----

  /// Stores a row and adds its value range to `totals`.
  void store_row(uint32_t level, uint32_t y, const float* row, PyramidTotals& totals) {
    switch (view_.format) {
      case TexelFormat::kU8:
        if (!view_.srgb) {
          store_tiles<uint8_t>(level, y, row, totals, [](float v, size_t) {
            return static_cast<uint8_t>(std::clamp(v, 0.f, 1.f) * 255.f + 0.5f);
          });
        } else {
          store_tiles<uint8_t>(level, y, row, totals, [](float v, size_t channel) {
            return channel == 3 ? static_cast<uint8_t>(std::clamp(v, 0.f, 1.f) * 255.f + 0.5f)
                                : linear_to_srgb(v);
          });
        }
        return;
      case TexelFormat::kF16:
        return store_tiles<uint16_t>(level, y, row, totals,
                                     [](float v, size_t) { return float_to_half(v); });
      case TexelFormat::kF32:
        return store_tiles<float>(level, y, row, totals, [](float v, size_t) { return v; });
    }
  }

  template <typename T, typename Encode>
  void store_tiles(uint32_t level, uint32_t y, const float* row, PyramidTotals& totals,
                   const Encode& encode) {
    if (channels_ == 1)
      store_texels<T, 1>(level, y, row, totals, encode);
    else
      store_texels<T, 4>(level, y, row, totals, encode);
  }

  template <typename T, uint32_t C, typename Encode>
  void store_texels(uint32_t level, uint32_t y, const float* row, PyramidTotals& totals,
                    const Encode& encode) {
    constexpr size_t kRow = kTile * C;
    RowRange<T, C, kRow> range;
    const TextureLevel& at = view_.levels[level];
    for (uint32_t x = 0; x < at.width; x += kTile, row += kRow) {
      T codes[kRow];
      const size_t n = size_t{std::min(kTile, at.width - x)} * C;
      for (size_t i = 0; i < n; ++i) codes[i] = encode(row[i], i % C);
      std::memcpy(storage_ + texel_index(at, x, y) * (C * sizeof(T)), codes, n * sizeof(T));
      range.extend(row, codes, n);
    }
    range.add_to(totals, encode, [&](T code, size_t c) {
      return decode_value(reinterpret_cast<const std::byte*>(&code), view_.format,
                          view_.srgb && c < 3);
    });
  }

  const TextureDesc& desc_;
  const TextureView& view_;
  std::byte* storage_;
  uint32_t channels_;
  uint32_t band_top_ = 0;  ///< mip level with one row per band
  std::vector<std::vector<Box>> columns_;
};

}  // namespace

size_t value_bytes(TexelFormat format) {
  switch (format) {
    case TexelFormat::kU8:
      return 1;
    case TexelFormat::kF16:
      return 2;
    case TexelFormat::kF32:
      return 4;
  }
  return 0;
}

float decode_value(const std::byte* p, TexelFormat format, bool srgb) {
  if (format == TexelFormat::kU8) {
    const auto code = static_cast<uint8_t>(*p);
    return srgb ? kSrgbToLinear[code] : static_cast<float>(code) * (1.f / 255.f);
  }
  if (format == TexelFormat::kF16) {
    uint16_t code;
    std::memcpy(&code, p, 2);
    return half_to_float<float>(code);
  }
  float value;
  std::memcpy(&value, p, 4);
  return value;
}

size_t texel_index(const TextureLevel& level, uint32_t x, uint32_t y) {
  const size_t tile = size_t{y / kTile} * level.tiles_x + x / kTile;
  return size_t{level.offset} + tile * (kTile * kTile) + (y % kTile) * kTile + x % kTile;
}

PyramidTotals build_pyramid(const TextureDesc& desc, const TextureView& view, std::byte* storage,
                            const ForEach& for_each) {
  return Pyramid(desc, view, storage).build(for_each);
}

}  // namespace wavecomb
