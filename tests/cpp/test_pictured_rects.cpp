// SPDX-License-Identifier: Apache-2.0
/// Rects that are sampled by their texture: chi-square over the texture from several points, both
/// techniques of MIS, irradiance by numerical integration, and the reduction of noise.
#include <gtest/gtest.h>

#include "light_charts.h"
#include "parts.h"

namespace wavecomb {
namespace {

using namespace light_testing;

constexpr uint32_t kTexelsX = 12, kTexelsY = 8;

std::vector<float> spots() {
  std::vector<float> rgb(size_t{kTexelsX} * kTexelsY * 3, 0.02f);
  for (const uint32_t texel : {2 * kTexelsX + 3, 5 * kTexelsX + 9, 5 * kTexelsX + 8})
    for (uint32_t c = 0; c < 3; ++c) rgb[texel * 3 + c] = 40;
  return rgb;
}
std::vector<float> half_dark() {
  std::vector<float> rgb;
  std::mt19937 rng(3);
  for (uint32_t y = 0; y < kTexelsY; ++y)
    for (uint32_t x = 0; x < kTexelsX * 3; ++x)
      rgb.push_back(x / 3 < kTexelsX / 2 ? 0.f : static_cast<float>(rng() % 100) / 10.f);
  return rgb;
}
std::vector<float> noise() {
  std::vector<float> rgb;
  std::mt19937 rng(4);
  for (uint32_t i = 0; i < kTexelsX * kTexelsY * 3; ++i)
    rgb.push_back(std::pow(static_cast<float>(rng() % 1000) / 1000.f, 4.f));
  return rgb;
}

struct Place {
  const char* name;
  Affine rect;
  Vec3<float> from;
};
const Place kPlaces[] = {
    {"from afar", rotate(25, 15) * translate(0.3f, -0.2f, 9) * scale(2, 3, 1), {0, 0, 0}},
    {"some way off", rotate(25, 15) * translate(0.3f, -0.2f, 1) * scale(2, 3, 1), {0, 0, 0}},
    {"close by", translate(0.3f, -0.2f, 0.05f) * scale(2, 3, 1), {0, 0, 0}},
    {"at grazing angles", translate(4, 0, 0.2f) * scale(2, 3, 1), {0, 0, 0}},
    {"mirrored", translate(0.3f, -0.2f, 1) * scale(-2, 3, 1), {0.5f, 0, 0}},
    {"sheared",
     Affine{{{1, 0.6f, 0}, {0, 1, 0}, {0, 0, 1}}, {0.5f, 0, 1}} * scale(2, 2, 2),
     {0, 0, 0}}};

Lights make_rect(const Place& place, const std::vector<float>& rgb) {
  Lights lights;
  Light light = make_light(LightKind::kRect, place.rect);
  light.texture = lights.add_texture(kTexelsX, kTexelsY, rgb);
  lights.build({light});
  return lights;
}

/// Point where a direction hits the rect, as fractions of its edges, and the squared distance over
/// area and cosine, which converts area density to solid angle density.
struct OnRect {
  double a, b, distance2, measure;
};
OnRect on_rect(const LightRecord& r, const Vec3<float>& from, double a, double b) {
  double d[3], d2 = 0, cosine = 0;
  for (int i = 0; i < 3; ++i) {
    const double f[3] = {from.x, from.y, from.z};
    d[i] = r.p[i] + a * r.u[i] + b * r.v[i] - f[i];
    d2 += d[i] * d[i];
  }
  for (int i = 0; i < 3; ++i) cosine -= d[i] / std::sqrt(d2) * r.n[i];
  return {a, b, d2, cosine * r.area / d2};
}

/// Light sampling density that MIS uses for paths that hit a point of the rect.
double hit_density(const LightView& view, const Vec3<float>& from, double a, double b,
                   Color<float>* radiance = nullptr) {
  const LightRecord& r = view.lights[0];
  double d[3], d2 = 0;
  const double f[3] = {from.x, from.y, from.z};
  for (int i = 0; i < 3; ++i) {
    d[i] = r.p[i] + a * r.u[i] + b * r.v[i] - f[i];
    d2 += d[i] * d[i];
  }
  const double n = std::sqrt(d2);
  const Vec3<float> dir(static_cast<float>(d[0] / n), static_cast<float>(d[1] / n),
                        static_cast<float>(d[2] / n));
  const auto hit = light_hit<float>(view, 0u, from, dir, static_cast<float>(n), true);
  if (radiance) *radiance = hit.radiance;
  return static_cast<double>(hit.pdf);
}

TEST(PicturedRect, PointsFollowTheDensityAndItsMassIs1) {
  const std::vector<float> pictures[] = {spots(), half_dark(), noise()};
  chi_square::Battery battery("pictured rects");
  for (const Place& place : kPlaces)
    for (size_t image = 0; image < std::size(pictures); ++image) {
      const Lights lights = make_rect(place, pictures[image]);
      ASSERT_NE(lights.view().lights[0].distribution, kNoDistribution);
      battery.run(light_case(std::string(place.name) + ", picture " + std::to_string(image),
                             lights.view(), place.from));
    }
  battery.judge();
}

TEST(PicturedRect, BothTechniquesSeeOneDensityAndOneRadiance) {
  std::mt19937 rng(5);
  const auto number = [&rng] { return static_cast<float>(rng() >> 8) * 0x1p-24f; };
  for (const Place& place : kPlaces) {
    const Lights lights = make_rect(place, spots());
    const LightView view = lights.view();
    int beside = 0;
    for (int i = 0; i < 20000; ++i) {
      const auto s = sample_light<float>(view, place.from, number(), number(), number(), true);
      ASSERT_TRUE(s.valid) << place.name;
      const auto t = trace(view, place.from, s.wi);
      const auto hit = light_hit<float>(view, 0u, place.from, s.wi, t.value_or(s.distance), true);
      // Rounding may move a direction across an edge of the rect or of a cell.
      const float most = 1e-3f * s.weight.y * s.pdf + 1e-5f;
      const bool same = t && std::fabs(hit.pdf / s.pdf - 1) < 1e-3f &&
                        std::fabs(hit.radiance.y - s.weight.y * s.pdf) < most * 20;
      beside += !same;
    }
    EXPECT_LT(beside, 60) << place.name;
  }
}

/// Mean and variance of the irradiance estimate on a surface that faces the centre of the rect.
struct Estimate {
  double mean, variance;
};
Estimate estimate(const Lights& lights, const Vec3<float>& from, int samples) {
  const LightView view = lights.view();
  const LightRecord& r = view.lights[0];
  std::mt19937 rng(8);
  const auto number = [&rng] { return static_cast<float>(rng() >> 8) * 0x1p-24f; };
  double sum = 0, squares = 0;
  for (int i = 0; i < samples; ++i) {
    const float pick = number(), u = number(), v = number();
    const auto s = sample_light<float>(view, from, pick, u, v, true);
    double cosine = 0;
    for (int k = 0; k < 3; ++k)
      cosine -= static_cast<double>(r.n[k]) * static_cast<double>(k == 0   ? s.wi.x
                                                                  : k == 1 ? s.wi.y
                                                                           : s.wi.z);
    const double x = s.valid ? static_cast<double>(s.weight.y) * std::max(0.0, cosine) : 0;
    sum += x;
    squares += x * x;
  }
  const double mean = sum / samples;
  return {mean, squares / samples - mean * mean};
}

TEST(PicturedRect, IrradianceIsThatOfItsPicture) {
  size_t index = 0;
  for (const Place& place : kPlaces)
    for (const auto& rgb : {spots(), half_dark(), noise()}) {
      // Tests every position of the rect, and every image at two positions.
      const size_t diagonal = index + index / 3;
      ++index;
      if (!includes_case(diagonal, 3)) continue;
      const Lights lights = make_rect(place, rgb);
      const LightView view = lights.view();
      const LightRecord& r = view.lights[0];
      constexpr int kN = 480;
      double exact = 0;
      for (int j = 0; j < kN; ++j)
        for (int i = 0; i < kN; ++i) {
          const double a = (i + 0.5) / kN, b = (j + 0.5) / kN;
          const OnRect at = on_rect(r, place.from, a, b);
          Color<float> radiance(0.f);
          hit_density(view, place.from, a, b, &radiance);
          // The receiver is parallel to the rect, so its cosine equals the rect's, which follows
          // from the measure.
          const double cosine = at.measure * at.distance2 / static_cast<double>(r.area);
          exact += static_cast<double>(radiance.y) * cosine * at.measure / kN / kN;
        }
      const int samples = 200000;
      const Estimate e = estimate(lights, place.from, samples);
      EXPECT_NEAR(e.mean, exact, 4.5 * std::sqrt(e.variance / samples) + 2e-3 * exact)
          << place.name;
    }
}

TEST(PicturedRect, ThePictureTakesNoiseAway) {
  for (const Place& place : kPlaces)
    for (const bool bright : {true, false}) {
      Lights by_texture = make_rect(place, bright ? spots() : noise());
      Lights evenly = make_rect(place, bright ? spots() : noise());
      evenly.set.records[0].distribution = kNoDistribution;
      const double gain = estimate(evenly, place.from, 100000).variance /
                          estimate(by_texture, place.from, 100000).variance;
      RecordProperty((std::string(bright ? "spots " : "noise ") + place.name).c_str(),
                     std::to_string(gain));
      std::printf("%s, %s: %.2f times less variance\n", bright ? "spots" : "noise", place.name,
                  gain);
      // A few bright spots give much less noise when sampled by texture. A noisy image never gives
      // much more noise when sampled by texture.
      EXPECT_GT(gain, bright ? 5 : 0.7) << place.name << (bright ? ", spots" : ", noise");
    }
}

TEST(PicturedRect, EvenAndBlackPictures) {
  const Lights grey =
      make_rect(kPlaces[1], std::vector<float>(size_t{kTexelsX} * kTexelsY * 3, 0.25f));
  EXPECT_EQ(grey.set.records[0].distribution, kNoDistribution);
  EXPECT_TRUE(grey.set.distributions.empty());
  const Lights plain({make_light(LightKind::kRect, kPlaces[1].rect)});
  for (const float u : {0.1f, 0.5f, 0.9f}) {
    const auto a = sample_light<float>(grey.view(), kPlaces[1].from, u, u, 0.3f, true);
    const auto b = sample_light<float>(plain.view(), kPlaces[1].from, u, u, 0.3f, true);
    EXPECT_EQ(a.pdf, b.pdf);
    EXPECT_EQ(a.wi.x, b.wi.x);
    EXPECT_FLOAT_EQ(a.weight.y * 4, b.weight.y);
  }
  const Lights black =
      make_rect(kPlaces[1], std::vector<float>(size_t{kTexelsX} * kTexelsY * 3, -1.f));
  EXPECT_EQ(black.set.records[0].texture, kNoTexture);
  EXPECT_EQ(black.set.records[0].selection_pdf, 0);
  EXPECT_FALSE(sample_light<float>(black.view(), kPlaces[1].from, 0.5f, 0.5f, 0.5f, true).valid);
}

TEST(PicturedRect, DensityIsPositiveWhereverThePictureIs) {
  // A single bright texel in large images, in the middle and in corners, with each wrap mode.
  for (const Wrap wrap : {Wrap::kClamp, Wrap::kRepeat})
    for (const auto& [w, h] : {std::pair{1u, 1u}, {3u, 2u}, {1500u, 1200u}})
      for (const size_t lit : {size_t{0}, size_t{w} * h / 2, size_t{w} * h - 1}) {
        std::vector<float> rgb(size_t{w} * h * 3, 0.f);
        rgb[3 * lit + 1] = 1e-3f;
        Lights lights;
        Light light = make_light(LightKind::kRect, kPlaces[1].rect);
        light.texture = lights.add_texture(w, h, rgb, wrap);
        lights.build({light});
        if (w * h == 1) continue;  // constant image
        const Distribution2D& d = lights.set.distributions.at(0);
        EXPECT_LE(d.width, 1024u);
        EXPECT_LE(d.height, 1024u);
        EXPECT_LT(d.spread, 0.9f);
        std::mt19937 rng(7);
        for (int i = 0; i < 400; ++i) {
          const auto near = [&](size_t at, uint32_t n) {
            const double x = (static_cast<double>(at) + 0.5 + (rng() % 1000 / 500.0 - 1)) / n;
            return static_cast<float>(x - std::floor(x));
          };
          const float s = near(lit % w, w), down = near(lit / w, h);
          const auto c =
              detail::rect_radiance<float>(detail::LightReader<float>(lights.set.records[0], true),
                                           lights.views.data(), s, 1.f - down, true);
          if (c.y > 1e-9f) {
            EXPECT_GT(detail::image_pdf_at<float>(d, s, down, true), 0.f) << w << " " << lit;
          }
        }
      }
}

}  // namespace
}  // namespace wavecomb
