// SPDX-License-Identifier: Apache-2.0
/// Value ranges of textures: no filter, level, wrap mode or lane width returns a value outside.
#include <cstring>

#include "lane_testing.h"
#include "wavecomb/core/encoding/hash.h"
#include "wavecomb/texture/half.h"
#include "wavecomb/texture/lookup.h"
#include "wavecomb/texture/texture.h"

namespace wavecomb {
namespace {

using namespace lane_testing;

constexpr TexelFormat kFormats[] = {TexelFormat::kU8, TexelFormat::kF16, TexelFormat::kF32};
constexpr Wrap kWraps[] = {Wrap::kRepeat, Wrap::kClamp, Wrap::kMirror, Wrap::kBlack};

/// Makes a texture of values, stored as `format`.
TexturePtr texture_of(const std::vector<float>& values, uint32_t width, uint32_t channels,
                      TexelFormat format, Wrap wrap = Wrap::kRepeat, bool srgb = false) {
  std::vector<std::byte> bytes;
  const auto append = [&bytes](const auto& code) {
    const auto* p = reinterpret_cast<const std::byte*>(&code);
    bytes.insert(bytes.end(), p, p + sizeof(code));
  };
  for (const float v : values) {
    if (format == TexelFormat::kU8)
      append(static_cast<uint8_t>(v * 255.f + 0.5f));
    else if (format == TexelFormat::kF16)
      append(float_to_half(v));
    else
      append(v);
  }
  const auto height = static_cast<uint32_t>(values.size() / channels / width);
  return std::make_shared<const Texture>(
      TextureDesc{"values", bytes.data(), width, height, channels, format, srgb, wrap, wrap});
}

std::vector<float> random_values(size_t n, float low, float high, uint32_t seed) {
  std::mt19937 rng(seed);
  std::uniform_real_distribution<float> uniform(low, high);
  std::vector<float> values(n);
  for (float& v : values) v = uniform(rng);
  return values;
}

/// Minimum and maximum of several thousand lookups: filtered and single texels, all levels, inside
/// and outside the image, at each lane width.
TexelRange seen(const Texture& texture, uint32_t seed) {
  TexelRange range{{kInf, kInf, kInf, kInf}, {-kInf, -kInf, -kInf, -kInf}};
  for_each_lane_type([&]<typename F>() {
    using U = UInt<F>;
    for (uint32_t i = 0; i < 2048; i += kWidth<F>) {
      const U at = lane_index<F>() + i;
      const auto random = [&](uint32_t k) { return hash_u32<U>(at, U(seed + k)); };
      const auto number = [&](uint32_t k) { return unit_float<F>(random(k)); };
      const F s = fma(number(0), F(4.f), F(-1.5f)), t = fma(number(1), F(4.f), F(-1.5f));
      const F width = number(2) * F(i % 3 == 0 ? 0.f : 1.2f);
      const Footprint<F> footprint =
          i % 2 == 0 ? Footprint<F>(width) : Footprint<F>(width, random(3));
      const Texel<F> x = lookup<F>(texture.view(), s, t, footprint, Mask<F>(true));
      const F value[4] = {x.r, x.g, x.b, x.a};
      for (size_t c = 0; c < 4; ++c)
        for (size_t k = 0; k < kWidth<F>; ++k) {
          range.low[c] = std::min(range.low[c], lane(value[c], k));
          range.high[c] = std::max(range.high[c], lane(value[c], k));
        }
    }
  });
  return range;
}

void expect_within(const TexelRange& inner, const TexelRange& outer, const std::string& what) {
  for (size_t c = 0; c < 4; ++c) {
    EXPECT_GE(inner.low[c], outer.low[c]) << what << " channel " << c;
    EXPECT_LE(inner.high[c], outer.high[c]) << what << " channel " << c;
  }
}

TEST(TextureRange, NoLookupLeavesIt) {
  uint32_t seed = 1;
  for (const TexelFormat format : kFormats)
    for (const Wrap wrap : kWraps)
      for (uint32_t channels = 1; channels <= 4; ++channels)
        for (const bool srgb : {false, true})
          for (const uint32_t width : {1u, 7u, 16u}) {
            const float low = format == TexelFormat::kU8 ? 0.2f : -3.f;
            const float high = format == TexelFormat::kU8 ? 0.9f : 2.f;
            const auto values = random_values(size_t{width} * 13 * channels, low, high, ++seed);
            const TexturePtr texture = texture_of(values, width, channels, format, wrap, srgb);
            expect_within(seen(*texture, seed), texture->range(),
                          std::to_string(channels) + " channels, " + std::to_string(width));
          }
}

TEST(TextureRange, IsThatOfTheTexels) {
  // The image has blocks of 8 x 8 equal texels, so coarser levels have the same values.
  std::vector<float> values(24 * 16 * 4);
  for (size_t i = 0; i < values.size(); ++i) {
    const size_t texel = i / 4, block = texel / 24 / 8 * 3 + texel % 24 / 8;
    values[i] = static_cast<float>(block * 10 + i % 4) / 255.f;
  }
  const auto near = [](float a, float b) { EXPECT_NEAR(a, b, 2e-6f); };
  for (const TexelFormat format : {TexelFormat::kU8, TexelFormat::kF32}) {
    const TexturePtr texture = texture_of(values, 24, 4, format);
    for (size_t c = 0; c < 4; ++c) {
      near(texture->range().low[c], static_cast<float>(c) / 255.f);
      near(texture->range().high[c], static_cast<float>(50 + c) / 255.f);
    }
  }
  // A range includes single texels anywhere in the image.
  for (const size_t i : {size_t{0}, size_t{17}, size_t{30 * 30 - 1}}) {
    std::vector<float> one(30 * 30, 0.5f);
    one[i] = 1.f;
    EXPECT_EQ(texture_of(one, 30, 1, TexelFormat::kU8)->range().high[0], 1.f * (1.f + 1e-6f));
  }
  // A missing alpha channel is 1; alpha of black outside the image is 0.
  const std::vector<float> grey(64, 1.f);
  EXPECT_EQ(texture_of(grey, 8, 1, TexelFormat::kU8)->range(),
            (TexelRange{{1, 1, 1, 1}, {1, 1, 1, 1}}));
  const TexelRange black = texture_of(grey, 8, 1, TexelFormat::kU8, Wrap::kBlack)->range();
  EXPECT_EQ(black.low, (std::array<float, 4>{0, 0, 0, 1}));
  EXPECT_EQ(texture_of(grey, 4, 4, TexelFormat::kU8, Wrap::kBlack)->range().low[3], 0.f);
}

TEST(TextureRange, WhatIsTheSameAllOverIsExact) {
  for (const TexelFormat format : kFormats)
    for (const float value : {0.f, 1.f, 55.f / 255.f})
      for (const bool srgb : {false, true})
        for (const uint32_t width : {1u, 8u, 21u}) {
          // Boxes of odd sizes round differently for float texels, so levels differ.
          if (format == TexelFormat::kF32 && width == 21 && value != 0) continue;
          const TexturePtr texture = texture_of(std::vector<float>(width * 8 * 3, value), width, 3,
                                                format, Wrap::kMirror, srgb);
          EXPECT_EQ(texture->range().low, texture->range().high) << value << " " << width;
          EXPECT_EQ(seen(*texture, 5), texture->range()) << value << " " << width;
        }
}

/// a + (b - a) t has rounding errors: filtering 1 and 1e-9 gives 0 in places. The interpolated
/// value never crosses 0, so non-negative values stay non-negative and non-positive values
/// non-positive.
TEST(TextureRange, FiltersRoundButNeverPass0) {
  std::vector<float> values(64 * 64);
  for (size_t i = 0; i < values.size(); ++i) values[i] = i % 2 == 0 ? 1.f : 1e-9f;
  const TexturePtr above = texture_of(values, 64, 1, TexelFormat::kF32);
  const Texel<float> between = lookup<float>(above->view(), 1.5f / 64 - 1e-9f, 0.5f, 0.f, true);
  EXPECT_LT(between.r, 1e-6f);
  EXPECT_EQ(above->range().low[0], 0.f);
  EXPECT_GE(seen(*above, 3).low[0], 0.f);
  expect_within(seen(*above, 3), above->range(), "above");
  for (float& v : values) v = -v;
  const TexturePtr below = texture_of(values, 64, 1, TexelFormat::kF32);
  EXPECT_EQ(below->range().high[0], 0.f);
  expect_within(seen(*below, 4), below->range(), "below");
  // Filtering the largest texels does not overflow.
  for (size_t i = 0; i < values.size(); ++i) values[i] = i % 3 == 0 ? 3e38f : -3e38f;
  const TexturePtr huge = texture_of(values, 64, 1, TexelFormat::kF32);
  EXPECT_TRUE(std::isfinite(huge->range().high[0]) && std::isfinite(huge->range().low[0]));
  expect_within(seen(*huge, 6), huge->range(), "huge");
}

TEST(TextureRange, BadPixelsCountAs0) {
  std::vector<float> values(64, 2.f);
  values[20] = kNan;
  const TexelRange range = texture_of(values, 8, 1, TexelFormat::kF32)->range();
  EXPECT_EQ(range.low[0], 0.f);
  EXPECT_NEAR(range.high[0], 2.f, 1e-5f);
}

TEST(TextureRange, TilesAndWhatIsMissingCount) {
  const TexturePtr dark = texture_of(std::vector<float>(64, 0.2f), 8, 1, TexelFormat::kF32);
  const TexturePtr light = texture_of(std::vector<float>(64, 0.6f), 8, 1, TexelFormat::kF32);
  const Texture tiles("face.<UDIM>.png", {{1001, dark}, {1002, light}}, {0.6f, 0.9f, 0.4f, 0.5f});
  const TexelRange& range = tiles.range();
  EXPECT_EQ(range.low, (std::array<float, 4>{0.2f, 0.2f, 0.2f, 0.5f}));
  EXPECT_EQ(range.high, (std::array<float, 4>{0.6f, 0.9f, 0.6f, 1.f}));
  expect_within(seen(tiles, 8), range, "tiles");
}

}  // namespace
}  // namespace wavecomb
