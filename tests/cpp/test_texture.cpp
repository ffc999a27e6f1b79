// SPDX-License-Identifier: Apache-2.0
/// Textures: conversions, mip pyramids and lane lookups, compared with naive double precision.
#include "wavecomb/texture/texture.h"

#include <functional>
#include <tuple>

#include "lane_testing.h"
#include "wavecomb/core/encoding/hash.h"
#include "wavecomb/core/error.h"
#include "wavecomb/texture/lookup.inl"
#include "wavecomb/texture/pyramid.h"

namespace wavecomb {
namespace {

using namespace lane_testing;
using Color4 = std::array<double, 4>;

double half_value(uint16_t h) {
  const int exponent = (h >> 10) & 31, mantissa = h & 1023;
  const double sign = (h & 0x8000) ? -1 : 1;
  if (exponent == 31)
    return mantissa ? std::nan("") : sign * std::numeric_limits<double>::infinity();
  return sign *
         (exponent == 0 ? std::ldexp(mantissa, -24) : std::ldexp(1024 + mantissa, exponent - 25));
}
double srgb_decode(double c) {
  return c <= 0.04045 ? c / 12.92 : std::pow((c + 0.055) / 1.055, 2.4);
}

TEST(Half, EveryValueInEveryLane) {
  for_each_lane_type([]<typename F>() {
    for (uint32_t h = 0; h < 65536; h += kWidth<F>) {
      const F x = half_to_float<F>(UInt<F>(h) + lane_index<F>());
      for (uint32_t k = 0; k < kWidth<F>; ++k) {
        const double exact = half_value(static_cast<uint16_t>(h + k));
        ASSERT_TRUE(same_bits(lane(x, k), static_cast<float>(exact))) << h + k;
      }
    }
  });
}

TEST(Half, RoundsToNearestEven) {
  for (uint32_t h = 0; h < 65536; ++h) {
    const auto half = static_cast<uint16_t>(h);
    const auto x = static_cast<float>(half_value(half));
    if (x != x) {
      EXPECT_TRUE(std::isnan(half_value(float_to_half(x))));
      continue;
    }
    ASSERT_EQ(float_to_half(x), half);
    // A value halfway between two half-precision numbers is rounded to the even one. The values
    // next to it are rounded to the nearest.
    const double next = half_value(static_cast<uint16_t>(h + 1));
    if ((h & 0x7fff) >= 0x7bff || !std::isfinite(next)) continue;
    const auto middle = static_cast<float>((static_cast<double>(x) + next) / 2);
    ASSERT_EQ(float_to_half(middle), half + (half & 1u));
    ASSERT_EQ(float_to_half(std::nextafter(middle, x)), half);
    ASSERT_EQ(float_to_half(std::nextafter(middle, static_cast<float>(next))), half + 1);
  }
  EXPECT_EQ(float_to_half(65519.f), 0x7bff);
  EXPECT_EQ(float_to_half(65520.f), 0x7c00);
  EXPECT_EQ(float_to_half(-1e30f), 0xfc00);
}

TEST(Srgb, TableAndItsInverse) {
  for (int i = 0; i < 256; ++i) {
    EXPECT_LE(ulps(kSrgbToLinear[static_cast<size_t>(i)], srgb_decode(i / 255.0)), 0.51) << i;
    EXPECT_EQ(linear_to_srgb(kSrgbToLinear[static_cast<size_t>(i)]), i);
    if (i < 255) {
      EXPECT_EQ(linear_to_srgb(static_cast<float>(srgb_decode((i + 0.499) / 255))), i);
      EXPECT_EQ(linear_to_srgb(static_cast<float>(srgb_decode((i + 0.501) / 255))), i + 1);
    }
  }
  EXPECT_EQ(linear_to_srgb(-1.f), 0);
  EXPECT_EQ(linear_to_srgb(kNan), 0);
  EXPECT_EQ(linear_to_srgb(9.f), 255);
}

TEST(Srgb, RoundsAtEveryStep) {
  // Finds by bisection the float at which the encoded value changes: half a step above, on the
  // exact curve.
  for (int i = 0; i < 255; ++i) {
    float below = kSrgbToLinear[static_cast<size_t>(i)],
          above = kSrgbToLinear[static_cast<size_t>(i + 1)];
    while (std::nextafter(below, above) < above) {
      const float middle = below + (above - below) / 2;
      (linear_to_srgb(middle) <= i ? below : above) = middle;
    }
    EXPECT_EQ(linear_to_srgb(below), i);
    EXPECT_EQ(linear_to_srgb(above), i + 1);
    EXPECT_LE(ulps(above, srgb_decode((i + 0.5) / 255)), 1.01) << i;
  }
}

/// An image in all forms that Texture accepts, with the linear values that it represents.
struct Image {
  TextureDesc desc;
  std::vector<unsigned char> bytes;
  std::vector<Color4> linear;

  Color4& at(uint32_t x, uint32_t y) { return linear[size_t{y} * desc.width + x]; }
};

Image make_image(uint32_t width, uint32_t height, uint32_t channels, TexelFormat format, bool srgb,
                 Wrap wrap_s = Wrap::kRepeat, Wrap wrap_t = Wrap::kRepeat, uint32_t seed = 1) {
  Image image;
  image.desc = {"test image", nullptr, width, height, channels, format, srgb, wrap_s, wrap_t};
  std::mt19937 rng(seed);
  for (size_t i = 0; i < size_t{width} * height; ++i) {
    double v[4] = {0, 0, 0, 1};
    for (uint32_t c = 0; c < channels; ++c) {
      const bool alpha = channels % 2 == 0 && c + 1 == channels;
      if (format == TexelFormat::kU8) {
        const auto code = static_cast<uint8_t>(rng() >> 13);
        image.bytes.push_back(code);
        v[c] = srgb && !alpha ? srgb_decode(code / 255.0) : code / 255.0;
      } else if (format == TexelFormat::kF16) {
        const uint16_t code = float_to_half(static_cast<float>(rng() % 4000) / 1000.f - 0.5f);
        image.bytes.push_back(static_cast<unsigned char>(code & 255));
        image.bytes.push_back(static_cast<unsigned char>(code >> 8));
        v[c] = half_value(code);
      } else {
        const float value = static_cast<float>(rng() % 4000) / 1000.f - 0.5f;
        unsigned char raw[4];
        std::memcpy(raw, &value, 4);
        image.bytes.insert(image.bytes.end(), raw, raw + 4);
        v[c] = static_cast<double>(value);
      }
    }
    if (channels == 1) image.linear.push_back({v[0], v[0], v[0], 1});
    if (channels == 2) image.linear.push_back({v[0], v[0], v[0], v[1]});
    if (channels >= 3) image.linear.push_back({v[0], v[1], v[2], v[3]});
  }
  return image;
}
Texture make_texture(Image& image) {
  image.desc.data = image.bytes.data();
  return Texture(image.desc);
}

const TexelFormat kFormats[] = {TexelFormat::kU8, TexelFormat::kF16, TexelFormat::kF32};
const Wrap kWraps[] = {Wrap::kRepeat, Wrap::kClamp, Wrap::kMirror, Wrap::kBlack};

TEST(Texture, StoresEveryTexel) {
  for (const TexelFormat format : kFormats)
    for (uint32_t channels = 1; channels <= 4; ++channels)
      for (const bool srgb : {false, true}) {
        Image image = make_image(37, 19, channels, format, srgb && format == TexelFormat::kU8);
        const Texture texture = make_texture(image);
        ASSERT_EQ(texture.view().channels, channels == 1 ? 1 : 4);
        double sum[4] = {0, 0, 0, 0};
        for (uint32_t y = 0; y < 19; ++y)
          for (uint32_t x = 0; x < 37; ++x) {
            const auto t = texel_at(texture.view(), 0, x, y);
            for (size_t c = 0; c < 4; ++c) {
              ASSERT_NEAR(t[c], image.at(x, y)[c], 1e-6);
              sum[c] += image.at(x, y)[c] / (37 * 19);
            }
          }
        for (size_t c = 0; c < 4; ++c) EXPECT_NEAR(texture.mean()[c], sum[c], 1e-6);
        EXPECT_EQ(texture.nonfinite_count(), 0u);
      }
}

/// Exact box filter of `image` to half its size.
Image shrink(Image& image) {
  const uint32_t w = image.desc.width, h = image.desc.height;
  Image out;
  out.desc.width = std::max(1u, w / 2);
  out.desc.height = std::max(1u, h / 2);
  const double sx = static_cast<double>(w) / out.desc.width,
               sy = static_cast<double>(h) / out.desc.height;
  for (uint32_t y = 0; y < out.desc.height; ++y)
    for (uint32_t x = 0; x < out.desc.width; ++x) {
      Color4 sum{};
      for (uint32_t j = 0; j < h; ++j)
        for (uint32_t i = 0; i < w; ++i) {
          const double ox = std::min<double>(i + 1, (x + 1) * sx) - std::max<double>(i, x * sx);
          const double oy = std::min<double>(j + 1, (y + 1) * sy) - std::max<double>(j, y * sy);
          if (ox <= 0 || oy <= 0) continue;
          for (size_t c = 0; c < 4; ++c) sum[c] += image.at(i, j)[c] * ox * oy / (sx * sy);
        }
      out.linear.push_back(sum);
    }
  return out;
}

TEST(Texture, EveryTexelHasAPlaceInItsTile) {
  for (const auto& [width, height] : {std::pair{192u, 128u}, {64u, 7u}, {1u, 1u}, {203u, 90u}}) {
    TextureDesc desc;
    desc.width = width;
    desc.height = height;
    TextureView view;
    const uint64_t bytes = lay_out(desc, view);
    std::vector<uint8_t> taken(bytes / view.channels);
    for (uint32_t n = 0; n < view.level_count; ++n) {
      const TextureLevel& level = view.levels[n];
      for (uint32_t y = 0; y < level.height; ++y)
        for (uint32_t x = 0; x < level.width; ++x) {
          const size_t at = texel_index(level, x, y);
          ASSERT_LT(at, taken.size());
          ASSERT_EQ(taken[at]++, 0) << x << ", " << y;
          const detail::LevelLanes<float> lanes = detail::broadcast_level<float>(level);
          ASSERT_EQ(detail::texel_offset<float>(lanes, x, y), at);
          ASSERT_EQ(at / 64, texel_index(level, x / 8 * 8, y / 8 * 8) / 64);  // one tile
        }
    }
  }
}

TEST(Texture, PyramidIsTheBoxFilterInLinearLight) {
  const uint32_t sizes[][2] = {{16, 16}, {17, 9}, {1, 7}, {13, 1}, {31, 30}, {3, 3}, {1, 1}};
  for (const TexelFormat format : kFormats)
    for (const bool srgb : {false, true})
      for (const uint32_t channels : {1u, 2u, 4u})
        for (const auto& size : sizes) {
          if (srgb && format != TexelFormat::kU8) continue;
          Image image = make_image(size[0], size[1], channels, format, srgb);
          const Texture texture = make_texture(image);
          const TextureView& view = texture.view();
          ASSERT_EQ(view.level_count,
                    static_cast<uint32_t>(std::bit_width(std::max(size[0], size[1]))));
          Image level = std::move(image);
          for (uint32_t n = 1; n < view.level_count; ++n) {
            level = shrink(level);
            ASSERT_EQ(view.levels[n].width, level.desc.width);
            ASSERT_EQ(view.levels[n].height, level.desc.height);
            for (uint32_t y = 0; y < level.desc.height; ++y)
              for (uint32_t x = 0; x < level.desc.width; ++x) {
                const auto t = texel_at(view, n, x, y);
                for (size_t c = 0; c < 4; ++c) {
                  const double exact = level.at(x, y)[c];
                  if (format == TexelFormat::kU8 && srgb && c < 3) {
                    const auto code = static_cast<double>(linear_to_srgb(t[c]));
                    ASSERT_GE(exact, srgb_decode((code - 0.501) / 255) - 1e-7);
                    ASSERT_LE(exact, srgb_decode((code + 0.501) / 255) + 1e-7);
                  } else {
                    const double step = format == TexelFormat::kU8 ? 0.501 / 255
                                        : format == TexelFormat::kF16
                                            ? 0.501 * 0x1p-10 * std::max(0.01, std::fabs(exact))
                                            : 1e-6;
                    ASSERT_NEAR(t[c], exact, step + 1e-6);
                  }
                }
              }
          }
        }
}

/// Index of a filter tap, or -1 for black.
int64_t wrap_tap(Wrap wrap, int64_t i, int64_t n) {
  switch (wrap) {
    case Wrap::kRepeat:
      return ((i % n) + n) % n;
    case Wrap::kClamp:
      return std::clamp<int64_t>(i, 0, n - 1);
    case Wrap::kMirror: {
      const int64_t m = ((i % (2 * n)) + 2 * n) % (2 * n);
      return m < n ? m : 2 * n - 1 - m;
    }
    case Wrap::kBlack:
      return i < 0 || i >= n ? -1 : i;
  }
  return 0;
}

/// Textbook bilinear lookup in the stored texels.
Color4 reference(const TextureView& view, uint32_t level, double s, double t) {
  const int64_t w = view.levels[level].width, h = view.levels[level].height;
  const double x = s * static_cast<double>(w) - 0.5, y = (1 - t) * static_cast<double>(h) - 0.5;
  const double x0 = std::floor(x), y0 = std::floor(y);
  Color4 sum{};
  for (int j = 0; j < 2; ++j)
    for (int i = 0; i < 2; ++i) {
      const int64_t u = wrap_tap(view.wrap_s, static_cast<int64_t>(x0) + i, w);
      const int64_t v = wrap_tap(view.wrap_t, static_cast<int64_t>(y0) + j, h);
      const double weight = (i ? x - x0 : 1 - (x - x0)) * (j ? y - y0 : 1 - (y - y0));
      std::array<float, 4> texel{0, 0, 0, view.has_alpha ? 0.f : 1.f};
      if (u >= 0 && v >= 0)
        texel = texel_at(view, level, static_cast<uint32_t>(u), static_cast<uint32_t>(v));
      for (size_t c = 0; c < 4; ++c) sum[c] += weight * static_cast<double>(texel[c]);
    }
  return sum;
}

Color4 reference(const TextureView& view, double s, double t, double width) {
  const double size = std::max(view.levels[0].width, view.levels[0].height);
  const double lod =
      width > 0 ? std::clamp(std::log2(width * size), 0.0, view.level_count - 1.0) : 0.0;
  const auto fine = static_cast<uint32_t>(lod);
  const uint32_t rough = std::min(fine + 1, view.level_count - 1);
  const Color4 a = reference(view, fine, s, t), b = reference(view, rough, s, t);
  Color4 sum{};
  for (size_t c = 0; c < 4; ++c) sum[c] = a[c] + (b[c] - a[c]) * (lod - fine);
  return sum;
}

/// Looks up all points with lane type F; returns all r, then g, b and a.
template <typename F>
std::vector<float> look_up(const TextureView& view, const std::vector<float>& s,
                           const std::vector<float>& t, const std::vector<float>& width) {
  std::vector<float> out(4 * s.size());
  for (size_t i = 0; i < s.size(); i += kWidth<F>) {
    const Texel<F> x =
        lookup<F>(view, load<F>(&s[i]), load<F>(&t[i]), load<F>(&width[i]), Mask<F>(true));
    store(&out[i], x.r);
    store(&out[s.size() + i], x.g);
    store(&out[2 * s.size() + i], x.b);
    store(&out[3 * s.size() + i], x.a);
  }
  return out;
}

/// Looks up one stochastically chosen texel per point; `bits` are the random bits.
template <typename F>
std::vector<float> look_up_one(const TextureView& view, const std::vector<float>& s,
                               const std::vector<float>& t, const std::vector<float>& width,
                               const std::vector<uint32_t>& bits) {
  std::vector<float> out(4 * s.size());
  for (size_t i = 0; i < s.size(); i += kWidth<F>) {
    const Footprint<F> footprint(load<F>(&width[i]), load<UInt<F>>(&bits[i]));
    const Texel<F> x = lookup<F>(view, load<F>(&s[i]), load<F>(&t[i]), footprint, Mask<F>(true));
    store(&out[i], x.r);
    store(&out[s.size() + i], x.g);
    store(&out[2 * s.size() + i], x.b);
    store(&out[3 * s.size() + i], x.a);
  }
  return out;
}

std::vector<uint32_t> random_bits(size_t n, uint32_t seed) {
  std::vector<uint32_t> bits(n);
  for (size_t i = 0; i < n; ++i)
    bits[i] = hash_u32<uint32_t>(static_cast<uint32_t>(i), uint32_t{seed});
  return bits;
}

TEST(Lookup, OneTexelIsTheSameAtEveryWidthOfLanes) {
  const auto s = padded({0.f, 1.f, 0.5f}, 513, -2.2f, 3.2f, 31);
  const auto t = padded({0.f, 1.f, 1.f}, 513, -2.2f, 3.2f, 32);
  const auto width = padded({0.f, -1.f, 1.f}, 513, -0.3f, 0.6f, 33);
  const auto bits = random_bits(s.size(), 34);
  for (const TexelFormat format : kFormats)
    for (const Wrap wrap : kWraps) {
      Image image = make_image(13, 21, 4, format, true, wrap, wrap, 35);
      const Texture texture = make_texture(image);
      const auto scalar = look_up_one<float>(texture.view(), s, t, width, bits);
      for_each_packet([&]<typename F>() {
        expect_same(scalar, look_up_one<F>(texture.view(), s, t, width, bits), "one texel");
      });
    }
}

/// Each texel is chosen with the probability of its filter weight. Random values on a grid, the
/// centres of 64 x 64 cells and 16 levels, reproduce the filtered mean up to the grid's resolution.
TEST(Lookup, OneTexelHasTheMeanOfTheFilter) {
  constexpr uint32_t kPlaces = 64, kLevels = 16;
  const auto s = padded({0.f, 1.f, 0.5f}, 41, -2.2f, 3.2f, 41);
  const auto t = padded({0.f, 1.f, 1.f}, 41, -2.2f, 3.2f, 42);
  const auto width = padded({0.f, 1.f, 0.07f}, 41, -0.1f, 0.3f, 43);
  for (const Wrap wrap : kWraps) {
    Image image = make_image(16, 8, 4, TexelFormat::kF32, false, wrap, wrap, 44);
    const Texture texture = make_texture(image);
    const TextureView view = texture.view();
    for (size_t i = 0; i < s.size(); ++i) {
      double mean = 0;
      for (uint32_t level = 0; level < kLevels; ++level)
        for (uint32_t y = 0; y < kPlaces; ++y)
          for (uint32_t x = 0; x < kPlaces; ++x) {
            const uint32_t bits = (level * (1024 / kLevels) + 512 / kLevels) << 22 |
                                  (y * (2048 / kPlaces) + 1024 / kPlaces) << 11 |
                                  (x * (2048 / kPlaces) + 1024 / kPlaces);
            mean += double{lookup<float>(view, s[i], t[i], {width[i], bits}, true).r};
          }
      mean /= kLevels * kPlaces * kPlaces;
      const double filtered = double{lookup<float>(view, s[i], t[i], width[i], true).r};
      // The weights of two levels and of two texels per axis are rounded to half of the grid's
      // resolution; texels differ by 4 at most.
      EXPECT_NEAR(mean, filtered, 4 * (0.5 / kLevels + 1.0 / kPlaces)) << i;
    }
  }
}

TEST(Lookup, AgreesWithTheReferenceInAllFormatsAndWraps) {
  const auto s = padded({0.f, 1.f, 0.5f, -0.f, 2.f, -1.f, 0.25f}, 1001, -2.2f, 3.2f, 21);
  const auto t = padded({0.f, 1.f, 1.f, 0.5f, -2.f, 3.f, 0.75f}, 1001, -2.2f, 3.2f, 22);
  auto width = padded({0.f, -1.f, 1.f, 0.f, 0.f, 0.f, 100.f}, 1001, -0.3f, 0.6f, 23);
  const uint32_t sizes[][2] = {{16, 8}, {13, 21}, {1, 5}, {2, 1}, {1, 1}};
  for (const TexelFormat format : kFormats)
    for (const uint32_t channels : {1u, 2u, 3u, 4u})
      for (const Wrap wrap_s : kWraps)
        for (const Wrap wrap_t : kWraps)
          for (const auto& size : sizes) {
            Image image =
                make_image(size[0], size[1], channels, format, channels % 2 == 0, wrap_s, wrap_t);
            const Texture texture = make_texture(image);
            const auto scalar = look_up<float>(texture.view(), s, t, width);
            for (size_t i = 0; i < s.size(); ++i) {
              const Color4 exact = reference(texture.view(), s[i], t[i], width[i]);
              for (size_t c = 0; c < 4; ++c) {
                ASSERT_NEAR(scalar[c * s.size() + i], exact[c], 1e-4)
                    << size[0] << " x " << size[1] << ", " << channels << " channels, at (" << s[i]
                    << ", " << t[i] << ") width " << width[i] << " wraps " << int(wrap_s)
                    << int(wrap_t);
              }
            }
            for_each_packet([&]<typename F>() {
              expect_same(scalar, look_up<F>(texture.view(), s, t, width), "lookup");
            });
          }
}

TEST(Lookup, FinestLevelAloneGivesTheSameBits) {
  // Lookups take a fast path unless a lane of the packet has a coarse footprint.
  Image image = make_image(64, 32, 4, TexelFormat::kU8, true);
  const Texture texture = make_texture(image);
  const auto s = padded({}, 512, -1.f, 2.f, 31), t = padded({}, 512, -1.f, 2.f, 32);
  const std::vector<float> fine(512, 0.f);
  auto mixed = fine;
  for (size_t i = 0; i < 512; i += 4) mixed[i] = 0.3f;
  const auto a = look_up<FloatP<16>>(texture.view(), s, t, fine),
             b = look_up<FloatP<16>>(texture.view(), s, t, mixed);
  for (size_t i = 0; i < a.size(); ++i) {
    if (i % 4 != 0) {
      ASSERT_TRUE(same_bits(a[i], b[i]));
    }
  }
}

TEST(Lookup, AnyCoordinateIsSafe) {
  auto values = awkward_floats();
  for (const float x : {1e6f, -1e6f, 3e9f, 1e15f, 0.99999994f, 1.0000001f, -1e-8f, -0x1p-149f})
    values.push_back(x);
  const auto [s, t] = all_pairs(values);
  for (const Wrap wrap : kWraps)
    for (const uint32_t size : {1u, 7u, 64u})
      for (const TexelFormat format : kFormats) {
        Image image = make_image(size, size, 4, format, false, wrap, wrap);
        const Texture texture = make_texture(image);
        for (const float w : {0.f, 0.7f, kNan, kInf, -kInf, 1e38f, 1e-40f}) {
          const std::vector<float> width(s.size(), w);
          const auto scalar = look_up<float>(texture.view(), s, t, width);
          for (const float x : scalar) ASSERT_TRUE(std::isfinite(x));
          for_each_packet([&, &s_ = s, &t_ = t]<typename F>() {
            expect_same(scalar, look_up<F>(texture.view(), s_, t_, width), "lookup");
          });
        }
        // NaN counts as 0.
        const auto nan = lookup<float>(texture.view(), kNan, kNan, 0.f, true);
        const auto zero = lookup<float>(texture.view(), 0.f, 0.f, 0.f, true);
        EXPECT_EQ(nan.r, zero.r);
      }
}

TEST(Lookup, ConstantTexturesAreExact) {
  const std::vector<float> data(7 * 5 * 3, 0.3f);
  const Texture texture(
      {"grey", data.data(), 7, 5, 3, TexelFormat::kF32, false, Wrap::kRepeat, Wrap::kMirror});
  const auto s = padded({}, 512, -3.f, 3.f, 41), t = padded({}, 512, -3.f, 3.f, 42),
             w = padded({}, 512, 0.f, 1.f, 43);
  const auto y = look_up<FloatP<8>>(texture.view(), s, t, w);
  for (size_t i = 0; i < 3 * 512; ++i) ASSERT_NEAR(y[i], 0.3f, 1e-7);
}

TEST(Lookup, TUpAndRowsDown) {
  const uint8_t rows[2] = {255, 0};  // white above black
  const Texture texture(
      {"rows", rows, 1, 2, 1, TexelFormat::kU8, false, Wrap::kClamp, Wrap::kClamp});
  EXPECT_EQ(lookup<float>(texture.view(), 0.5f, 1.f, 0.f, true).r, 1.f);
  EXPECT_EQ(lookup<float>(texture.view(), 0.5f, 0.f, 0.f, true).g, 0.f);
  EXPECT_FLOAT_EQ(lookup<float>(texture.view(), 0.5f, 0.5f, 0.f, true).b, 0.5f);
  EXPECT_EQ(lookup<float>(texture.view(), 0.5f, 0.5f, 0.f, true).a, 1.f);
}

TEST(Lookup, IdPerLane) {
  std::vector<Texture> textures;
  std::vector<TextureView> views;
  for (uint32_t i = 0; i < 5; ++i) {
    Image image =
        make_image(8 + i, 9, 1 + i % 4, kFormats[i % 3], i == 0, kWraps[i % 4], kWraps[i % 3], i);
    textures.push_back(make_texture(image));
  }
  for (const Texture& t : textures) views.push_back(t.view());
  const auto s = padded({}, 4096, -2.f, 2.f, 51), t = padded({}, 4096, -2.f, 2.f, 52),
             w = padded({}, 4096, 0.f, 0.4f, 53);
  std::vector<uint32_t> id(4096);
  std::mt19937 rng(54);
  for (size_t i = 0; i < id.size(); ++i) {
    id[i] = i < 1024 ? 3u : static_cast<uint32_t>(rng()) % 6u;
    if (id[i] == 5) id[i] = kNoTexture;
  }
  std::vector<float> expected;
  for (size_t i = 0; i < id.size(); ++i) {
    if (id[i] == kNoTexture) {
      expected.insert(expected.end(), {0.f, 0.f, 0.f, 1.f});
    } else {
      const auto x = lookup<float>(views[id[i]], s[i], t[i], w[i], true);
      expected.insert(expected.end(), {x.r, x.g, x.b, x.a});
    }
  }
  for_each_lane_type([&]<typename F>() {
    std::vector<float> result(expected.size());
    for (size_t i = 0; i < id.size(); i += kWidth<F>) {
      const Texel<F> x = lookup<F>(views.data(), load<UInt<F>>(&id[i]), load<F>(&s[i]),
                                   load<F>(&t[i]), load<F>(&w[i]), Mask<F>(true));
      for (size_t k = 0; k < kWidth<F>; ++k) {
        const float lanes[4] = {lane(x.r, k), lane(x.g, k), lane(x.b, k), lane(x.a, k)};
        std::copy(lanes, lanes + 4, result.begin() + static_cast<std::ptrdiff_t>(4 * (i + k)));
      }
    }
    expect_same(expected, result, "lookup by id");
    // Inactive lanes may hold invalid ids.
    const Mask<F> none_active(false);
    lookup<F>(views.data(), UInt<F>(12345u), F(0.f), F(0.f), F(0.f), none_active);
  });
}

/// Makes tiles 1001, 1002 and 1100 of different sizes and formats.
Texture make_tiles(std::vector<std::pair<uint32_t, TexturePtr>>& tiles) {
  for (const uint32_t number : {1001u, 1002u, 1100u}) {
    Image image = make_image(8 + number % 7, 9, 1 + number % 4, kFormats[number % 3],
                             number == 1002, Wrap::kClamp, Wrap::kClamp, number);
    tiles.emplace_back(number, std::make_shared<const Texture>(make_texture(image)));
  }
  return Texture("face.<UDIM>.png", tiles, {0.25f, 0.5f, 0.75f, 1.f});
}

TEST(Tiles, AreLookedUpWhereTheyLie) {
  std::vector<std::pair<uint32_t, TexturePtr>> tiles;
  const Texture texture = make_tiles(tiles);
  EXPECT_EQ(texture.spanned_bytes(), texture.bytes() + tiles[0].second->bytes() +
                                         tiles[1].second->bytes() + tiles[2].second->bytes());
  for (const auto& [number, tile] : tiles) {
    const auto column = static_cast<float>((number - 1001) % 10),
               row = static_cast<float>((number - 1001) / 10);
    for (const float at : {0.f, 0.25f, 0.875f})
      for (const float width : {0.f, 0.25f}) {
        const auto one = lookup<float>(tile->view(), at, 0.5f, width, true);
        const auto all = lookup<float>(texture.view(), column + at, row + 0.5f, width, true);
        EXPECT_EQ(std::tie(one.r, one.g, one.b, one.a), std::tie(all.r, all.g, all.b, all.a));
      }
  }
  // Tile 1003 and every tile outside are missing.
  for (const auto& [s, t] : {std::pair{2.5f, 0.5f}, {-0.5f, 0.5f}, {0.5f, -1e30f}, {10.f, 0.5f}}) {
    const auto none = lookup<float>(texture.view(), s, t, 0.25f, true);
    EXPECT_EQ(std::tie(none.r, none.g, none.b, none.a), std::make_tuple(0.25f, 0.5f, 0.75f, 1.f));
  }
}

TEST(Tiles, PacketEqualsScalarBitForBit) {
  std::vector<std::pair<uint32_t, TexturePtr>> tiles;
  const Texture texture = make_tiles(tiles);
  auto s = padded(awkward_floats(), 2048, -0.5f, 2.5f, 71), t = padded({}, s.size(), 0.f, 1.f, 72);
  t.resize(s.size(), 9.5f);
  for (size_t i = 0; i < s.size(); i += 3) s[i] = 9.25f, t[i] = 9.75f;  // tile 1100
  auto width = padded({}, s.size(), -0.1f, 0.4f, 73);
  width.resize(s.size(), 0.f);
  const auto scalar = look_up<float>(texture.view(), s, t, width);
  for_each_packet(
      [&]<typename F>() { expect_same(scalar, look_up<F>(texture.view(), s, t, width), "tiles"); });
}

TEST(Tiles, BadOnesAreRefusedByName) {
  std::vector<std::pair<uint32_t, TexturePtr>> tiles;
  const auto whole = std::make_shared<const Texture>(make_tiles(tiles));
  const auto refuse = [](std::vector<std::pair<uint32_t, TexturePtr>> bad) {
    try {
      const Texture texture("face", bad, {0, 0, 0, 1});
    } catch (const Error& e) {
      return std::string(e.what());
    }
    return std::string();
  };
  const TexturePtr tile = tiles[0].second;
  EXPECT_EQ(refuse({}), "texture 'face': has no tiles");
  EXPECT_EQ(refuse({{1101, tile}}), "texture 'face': tile 1101 is not one of 1001 to 1100");
  EXPECT_EQ(refuse({{1000, tile}}), "texture 'face': tile 1000 is not one of 1001 to 1100");
  EXPECT_EQ(refuse({{1004, tile}, {1004, tile}}), "texture 'face': has tile 1004 twice");
  EXPECT_EQ(refuse({{1004, whole}}), "texture 'face': tile 1004 is not a plain texture");
}

TEST(Texture, BadValuesBecome0AndAreCounted) {
  std::vector<float> data(16, 1.f);
  data[3] = kNan;
  data[5] = kInf;
  data[7] = -kInf;
  data[9] = -2.f;
  data[11] = 3e38f;
  const Texture texture({"bad", data.data(), 4, 4, 1, TexelFormat::kF32});
  EXPECT_EQ(texture.nonfinite_count(), 3u);
  EXPECT_EQ(texel_at(texture.view(), 0, 3, 0)[0], 0.f);
  EXPECT_EQ(texel_at(texture.view(), 0, 1, 2)[0], -2.f);
  EXPECT_EQ(texel_at(texture.view(), 0, 3, 2)[0], Texture::kMaxTexel);
  const std::vector<uint16_t> halfs(16, 0x7e00);
  EXPECT_EQ(Texture({"half", halfs.data(), 2, 2, 4, TexelFormat::kF16}).nonfinite_count(), 16u);
}

TEST(Texture, BadDescriptionsAreRefusedByName) {
  const uint8_t pixel[4] = {};
  const auto message = [&](uint32_t w, uint32_t h, uint32_t channels,
                           const void* data) -> std::string {
    try {
      Texture({"/World/Looks/wood", data, w, h, channels, TexelFormat::kU8});
    } catch (const Error& e) {
      return e.what();
    }
    return "";
  };
  for (const std::string& m :
       {message(0, 1, 3, pixel), message(1, 0, 3, pixel), message(65537, 1, 3, pixel),
        message(1, 1, 0, pixel), message(1, 1, 5, pixel), message(1, 1, 3, nullptr),
        message(65536, 65536, 4, pixel)}) {
    EXPECT_NE(m.find("/World/Looks/wood"), std::string::npos) << m;
    EXPECT_EQ(m.find('\n'), std::string::npos);
  }
  EXPECT_EQ(message(1, 1, 3, pixel), "");
}

TEST(Texture, KeepsItsFormatInMemory) {
  const std::vector<uint8_t> data(64 * 64 * 3);
  const Texture texture({"rgb", data.data(), 64, 64, 3, TexelFormat::kU8});
  EXPECT_LE(texture.bytes(), size_t{64 * 64 * 4} * 3 / 2);
  EXPECT_EQ(reinterpret_cast<uintptr_t>(texture.view().texels) % 64, 0u);
}

TEST(Texture, AnyOrderOfWorkGivesTheSameBits) {
  // The lookups run in reverse order; the results must also match beyond the image edges.
  const ForEach backwards = [](size_t n, const std::function<void(size_t)>& body) {
    while (n > 0) body(--n);
  };
  for (const auto& [width, height] : {std::pair{64u, 192u}, {129u, 96u}, {100u, 65u}, {1u, 40u}}) {
    for (const TexelFormat format : {TexelFormat::kU8, TexelFormat::kF16, TexelFormat::kF32}) {
      for (const uint32_t channels : {1u, 3u}) {
        Image image = make_image(width, height, channels, format, true);
        image.desc.data = image.bytes.data();
        const Texture a(image.desc), b(image.desc, backwards);
        ASSERT_EQ(a.bytes(), b.bytes());
        EXPECT_EQ(std::memcmp(a.view().texels, b.view().texels, a.bytes()), 0);
        EXPECT_EQ(std::memcmp(a.mean(), b.mean(), 4 * sizeof(float)), 0);
      }
    }
  }
}

}  // namespace
}  // namespace wavecomb
