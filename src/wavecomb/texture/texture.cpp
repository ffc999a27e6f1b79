// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/texture/texture.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <new>

#include "wavecomb/core/error.h"
#include "wavecomb/texture/half.h"
#include "wavecomb/texture/srgb.h"

namespace wavecomb {

namespace {

constexpr std::align_val_t kAlignment{64};
constexpr uint64_t kMaxBytes = uint64_t{1}
                               << 33;  // 2^31 words: what a signed 32-bit gather reaches

using Color4 = std::array<float, 4>;

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

/// Place of a texel in the storage of a texture, in texels.
size_t texel_index(const TextureLevel& level, uint32_t x, uint32_t y) {
  constexpr uint32_t kTile = TextureView::kTile;
  const size_t tile = size_t{y / kTile} * level.tiles_x + x / kTile;
  return level.offset + tile * (kTile * kTile) + (y % kTile) * kTile + x % kTile;
}

/// Stores one linear value in place `i` of the storage.
void put(std::byte* storage, const TextureView& view, size_t i, bool is_alpha, float value) {
  if (view.format == TexelFormat::kU8) {
    const float unit = std::clamp(value, 0.f, 1.f);
    const uint8_t code =
        view.srgb && !is_alpha ? linear_to_srgb(unit) : static_cast<uint8_t>(unit * 255.f + 0.5f);
    std::memcpy(storage + i, &code, 1);
  } else if (view.format == TexelFormat::kF16) {
    const uint16_t code = float_to_half(value);
    std::memcpy(storage + 2 * i, &code, 2);
  } else {
    std::memcpy(storage + 4 * i, &value, 4);
  }
}

float decode(const std::byte* p, TexelFormat format, bool srgb) {
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

/// A row or a level of float texels with `channels` values each.
struct Image {
  uint32_t width = 0, height = 0, channels = 0;
  std::vector<float> values;
  float* row(uint32_t y) { return values.data() + size_t{y} * width * channels; }
};

/// Source texels under destination texel i of n, when `size` texels shrink to n: the first, and the
/// part of each that is covered (source texels; they sum to size / n).
struct Box {
  uint32_t first;
  std::vector<float> weights;
};
std::vector<Box> make_boxes(uint32_t size, uint32_t n) {
  std::vector<Box> boxes(n);
  for (uint64_t i = 0; i < n; ++i) {
    // Exact in units of 1 / n source texels.
    const uint64_t begin = i * size, end = begin + size;
    boxes[i].first = static_cast<uint32_t>(begin / n);
    for (uint64_t j = begin / n; j * n < end; ++j) {
      const uint64_t covered = std::min(end, (j + 1) * n) - std::max(begin, j * n);
      boxes[i].weights.push_back(static_cast<float>(covered) / static_cast<float>(size));
    }
  }
  return boxes;
}

/// Shrinks an image whose rows `fetch` gives, by boxes.
template <typename Fetch>
Image shrink(uint32_t width, uint32_t height, uint32_t channels, const Fetch& fetch) {
  Image out{std::max(1u, width / 2), std::max(1u, height / 2), channels, {}};
  out.values.assign(size_t{out.width} * out.height * channels, 0.f);
  const auto columns = make_boxes(width, out.width), rows = make_boxes(height, out.height);
  for (uint32_t y = 0; y < out.height; ++y) {
    float* to = out.row(y);
    for (uint32_t j = 0; j < rows[y].weights.size(); ++j) {
      const float* from = fetch(rows[y].first + j);
      for (uint32_t x = 0; x < out.width; ++x) {
        const Box& box = columns[x];
        const float* p = from + size_t{box.first} * channels;
        for (uint32_t c = 0; c < channels; ++c) {
          float sum = 0;
          for (size_t i = 0; i < box.weights.size(); ++i)
            sum += box.weights[i] * p[i * channels + c];
          to[size_t{x} * channels + c] += rows[y].weights[j] * sum;
        }
      }
    }
  }
  return out;
}

/// Reads rows of the caller's pixels as linear floats with the channels that are stored.
class RowReader {
 public:
  RowReader(const TextureDesc& desc, const TextureView& view)
      : desc_(desc), srgb_(view.srgb), stored_(view.channels), row_(size_t{desc.width} * stored_) {}

  const float* operator()(uint32_t y) const {
    const size_t bytes = value_bytes(desc_.format);
    const auto* p = static_cast<const std::byte*>(desc_.data) +
                    size_t{y} * desc_.width * desc_.channels * bytes;
    nonfinite_ = 0;
    for (uint32_t x = 0; x < desc_.width; ++x) {
      float v[4] = {0, 0, 0, 1};
      for (uint32_t c = 0; c < desc_.channels; ++c, p += bytes) {
        const bool is_alpha = desc_.channels % 2 == 0 && c + 1 == desc_.channels;
        v[c] = sane(decode(p, desc_.format, srgb_ && !is_alpha));
      }
      if (desc_.channels == 2) {
        v[3] = v[1];
        v[1] = v[2] = v[0];
      }
      std::copy(v, v + stored_, row_.begin() + static_cast<std::ptrdiff_t>(size_t{x} * stored_));
    }
    return row_.data();
  }
  /// Values of the last row read that were not finite.
  uint64_t nonfinite() const { return nonfinite_; }

 private:
  float sane(float value) const {
    if (!is_finite(value)) {
      ++nonfinite_;
      return 0;
    }
    return std::clamp(value, -Texture::kMaxTexel, Texture::kMaxTexel);
  }

  const TextureDesc& desc_;
  bool srgb_;
  uint32_t stored_;
  mutable std::vector<float> row_;
  mutable uint64_t nonfinite_ = 0;
};

void put_row(std::byte* storage, const TextureView& view, uint32_t level, uint32_t y,
             const float* row) {
  for (uint32_t x = 0; x < view.levels[level].width; ++x) {
    const size_t first = texel_index(view.levels[level], x, y) * view.channels;
    for (uint32_t c = 0; c < view.channels; ++c) {
      put(storage, view, first + c, c == 3, row[size_t{x} * view.channels + c]);
    }
  }
}

}  // namespace

void Texture::Free::operator()(std::byte* p) const {
  ::operator delete[](p, kAlignment);
}

Texture::Texture(const TextureDesc& desc) : name_(desc.name) {
  check(desc);
  view_.format = desc.format;
  view_.channels = desc.channels == 1 ? 1 : 4;
  view_.srgb = desc.srgb && desc.format == TexelFormat::kU8;
  view_.has_alpha = desc.channels % 2 == 0;
  view_.wrap_s = desc.wrap_s;
  view_.wrap_t = desc.wrap_t;

  constexpr uint32_t kTile = TextureView::kTile;
  uint64_t texels = 0;
  uint32_t width = desc.width, height = desc.height;
  for (uint32_t& n = view_.level_count; n < TextureView::kMaxLevels;) {
    const uint32_t tiles_x = (width + kTile - 1) / kTile, tiles_y = (height + kTile - 1) / kTile;
    view_.levels[n++] = {width, height, tiles_x, 0, texels};
    texels += uint64_t{tiles_x} * tiles_y * kTile * kTile;
    if (width == 1 && height == 1) break;
    width = std::max(1u, width / 2);
    height = std::max(1u, height / 2);
  }
  const uint64_t total = texels * view_.channels * value_bytes(desc.format);
  if (total >= kMaxBytes) {
    throw Error("texture '" + desc.name + "': its mip levels take " + std::to_string(total >> 30) +
                " GiB; 8 GiB is the most; make it smaller");
  }
  bytes_ = static_cast<size_t>(total);
  storage_.reset(static_cast<std::byte*>(::operator new[](bytes_, kAlignment)));
  std::memset(storage_.get(), 0, bytes_);
  view_.texels = storage_.get();

  const RowReader read(desc, view_);
  double sum[4] = {0, 0, 0, 0};
  for (uint32_t y = 0; y < desc.height; ++y) {
    const float* row = read(y);
    nonfinite_count_ += read.nonfinite();
    put_row(storage_.get(), view_, 0, y, row);
    for (size_t i = 0; i < size_t{desc.width} * view_.channels; ++i)
      sum[i % view_.channels] += double{row[i]};
  }
  const double count = double(desc.width) * double(desc.height);
  for (uint32_t c = 0; c < view_.channels; ++c) mean_[c] = static_cast<float>(sum[c] / count);
  if (view_.channels == 1) mean_[1] = mean_[2] = mean_[0];

  // Levels come of one another in float; only what is stored is rounded to the format.
  Image image;
  for (uint32_t n = 1; n < view_.level_count; ++n) {
    if (n == 1) {
      image = shrink(desc.width, desc.height, view_.channels, read);
    } else {
      image = shrink(image.width, image.height, view_.channels,
                     [&image](uint32_t y) { return image.row(y); });
    }
    for (uint32_t y = 0; y < image.height; ++y) put_row(storage_.get(), view_, n, y, image.row(y));
  }
}

std::array<float, 4> texel_at(const TextureView& view, uint32_t level, uint32_t x, uint32_t y) {
  const size_t bytes = value_bytes(view.format);
  const auto* p = static_cast<const std::byte*>(view.texels) +
                  texel_index(view.levels[level], x, y) * view.channels * bytes;
  Color4 c{0, 0, 0, 1};
  for (uint32_t i = 0; i < view.channels; ++i) {
    c[i] = decode(p + i * bytes, view.format, view.srgb && i < 3);
  }
  if (view.channels == 1) c[1] = c[2] = c[0];
  if (!view.has_alpha) c[3] = 1;
  return c;
}

}  // namespace wavecomb
