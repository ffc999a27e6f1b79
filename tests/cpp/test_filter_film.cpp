// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <random>

#include "numbers_testing.h"
#include "wavecomb/film/film.h"
#include "wavecomb/film/filter.h"
#include "wavecomb/path/camera/camera_ray.h"

namespace wavecomb {
namespace {

using numbers_testing::kPiD;

struct FilterCase {
  FilterKind kind;
  const char* name;
  std::function<double(double)> value;  ///< over [-1, 1]
};
const std::vector<FilterCase>& filters() {
  static const std::vector<FilterCase> all = {
      {FilterKind::kBox, "box", [](double) { return 1.0; }},
      // The standard deviation is width / 6, which is 1/3 of the half width. A constant is
      // subtracted so that the filter is 0 at its ends.
      {FilterKind::kGaussian, "gaussian",
       [](double x) { return std::exp(-x * x * 9 / 2) - std::exp(-9.0 / 2); }},
      {FilterKind::kBlackmanHarris, "Blackman-Harris", [](double x) {
         // The 4-term Blackman-Harris window, with its middle at x = 0 (F. Harris, 1978).
         return 0.35875 + 0.48829 * std::cos(kPiD * x) + 0.14128 * std::cos(2 * kPiD * x) +
                0.01168 * std::cos(3 * kPiD * x);
       }}};
  return all;
}

/// Returns the integral of x^power f(x) from -1 to `end`, by the midpoint rule.
double integral(const FilterCase& f, double end, int power = 0) {
  constexpr int kSteps = 20000;
  double sum = 0;
  for (int i = 0; i < kSteps; ++i) {
    const double x = -1 + (end + 1) * (i + 0.5) / kSteps;
    sum += std::pow(x, power) * f.value(x);
  }
  return sum * (end + 1) / kSteps;
}

TEST(Filter, TableInvertsTheCumulativeDistribution) {
  for (const FilterCase& f : filters()) {
    const double total = integral(f, 1);
    for (const float width : {1.f, 3.f, 0.01f, 32.f}) {
      const FilterTable table(f.kind, width);
      const float* x = table.offsets();
      EXPECT_NEAR(x[0], -0.5 * width, 1e-3 * width) << f.name;
      EXPECT_NEAR(x[FilterTable::kBins], 0.5 * width, 1e-3 * width) << f.name;
      EXPECT_EQ(x[FilterTable::kBins + 1], x[FilterTable::kBins]);
      for (uint32_t i = 0; i <= FilterTable::kBins; ++i) {
        if (i > 0) {
          EXPECT_GE(x[i], x[i - 1]) << f.name;
        }
        if (i % 64 != 0) continue;
        const double u = static_cast<double>(i) / FilterTable::kBins;
        EXPECT_NEAR(integral(f, x[i] / (0.5 * width)) / total, u, 2e-5) << f.name << " " << i;
      }
    }
  }
}

TEST(Filter, SamplesHaveTheFiltersMoments) {
  for (const FilterCase& f : filters()) {
    const double total = integral(f, 1);
    const FilterTable table(f.kind, 2);  // half width 1
    constexpr int kSamples = 1 << 16;
    double moment[5] = {};
    for (int i = 0; i < kSamples; ++i) {
      const float u = (static_cast<float>(i) + 0.5f) / kSamples;
      const double x = filter_offset<float>(table.offsets(), u, true);
      EXPECT_LE(std::abs(x), 1.0);
      for (int p = 1; p <= 4; ++p) moment[p] += std::pow(x, p) / kSamples;
    }
    for (int p = 1; p <= 4; ++p)
      EXPECT_NEAR(moment[p], integral(f, 1, p) / total, 5e-4) << f.name << ", moment " << p;
  }
}

TEST(Filter, LastNumberStaysInside) {
  const FilterTable table(FilterKind::kBlackmanHarris, 3);
  const float last = 0x1.fffffep-1f;
  EXPECT_LE(filter_offset<float>(table.offsets(), last, true), 1.5f);
  EXPECT_GE(filter_offset<float>(table.offsets(), 0.f, true), -1.5f);
}

TEST(Film, ManySamplesStayExact) {
  Film film(2, 1, {});
  std::mt19937 rng(1);
  std::uniform_real_distribution<float> uniform(0, 10);
  constexpr uint32_t kSamples = 65536;
  long double exact[3] = {};
  Film::Pixel& p = film.pixel(1, 0);
  for (uint32_t i = 0; i < kSamples; ++i) {
    const float r = uniform(rng), g = 0.1f, b = i == 0 ? 1e6f : 1e-3f;
    p.r += r;
    p.g += g;
    p.b += b;
    exact[0] += r;
    exact[1] += g;
    exact[2] += b;
    ++p.samples;
  }
  const std::vector<float> beauty = film.beauty();
  for (size_t c = 0; c < 3; ++c)
    EXPECT_EQ(beauty[3 + c], static_cast<float>(exact[c] / kSamples)) << c;
  EXPECT_EQ(beauty[4], 0.1f);
  // A pixel without samples is black, without a division by zero.
  EXPECT_EQ(beauty[0], 0);
  EXPECT_EQ(film.samples(), (std::vector<uint32_t>{0, kSamples}));
  EXPECT_EQ(film.depth()[0], std::numeric_limits<float>::infinity());
}

TEST(Film, AovsAreMeans) {
  Film film(3, 2, {});
  film.pixel(2, 1).samples = 4;
  AovFilm& aovs = film.aovs();
  const size_t pixel = film.index(2, 1);
  ASSERT_NE(aovs.sums(Aov::kAlbedo, pixel), nullptr);
  aovs.sums(Aov::kAlbedo, pixel)[1] = 2;
  aovs.sums(Aov::kNormal, pixel)[2] = -1;
  for (const float depth : {2.f, 3.f, 4.f}) {
    aovs.add(Aov::kDepth, pixel, &depth);
    aovs.count_hit(pixel);
  }
  EXPECT_EQ(film.albedo()[3 * 5 + 1], 0.5f);
  EXPECT_EQ(film.normal()[3 * 5 + 2], -0.25f);
  EXPECT_EQ(film.depth()[5], 3);
  EXPECT_EQ(film.depth()[0], std::numeric_limits<float>::infinity());
}

TEST(Film, FinishGivesTheSameMeans) {
  Film film(5, 3, {});
  std::mt19937 rng(2);
  std::uniform_real_distribution<double> uniform(-3, 3);
  for (uint32_t y = 0; y < film.height(); ++y)
    for (uint32_t x = 0; x < film.width(); ++x) {
      const uint32_t n = x + 5 * y;
      film.pixel(x, y) = {uniform(rng), uniform(rng), uniform(rng), n};
      const size_t pixel = film.index(x, y);
      for (const Aov aov : {Aov::kAlbedo, Aov::kNormal, Aov::kDepth})
        for (uint32_t c = 0; c < row_of(aov).channels; ++c)
          film.aovs().sums(aov, pixel)[c] = uniform(rng);
      for (uint32_t i = 0; i < n / 2; ++i) film.aovs().count_hit(pixel);
    }
  const Film before = film;
  const Film::Layers layers = std::move(film).finish({});
  EXPECT_EQ(layers.beauty, before.beauty());
  EXPECT_EQ(layers.albedo, before.albedo());
  EXPECT_EQ(layers.normal, before.normal());
  EXPECT_EQ(layers.depth, before.depth());
  EXPECT_EQ(layers.samples, before.samples());
  EXPECT_EQ(layers.samples[14], 14u);
}

TEST(Film, WithoutAovs) {
  const Film film(3, 2, {AovSet{0}});
  EXPECT_EQ(Film(3, 2, {AovSet{0}}).aovs().sums(Aov::kAlbedo, 0), nullptr);
  EXPECT_EQ(film.aovs().bytes(), 0u);
  EXPECT_TRUE(Film(film).finish({}).aovs.empty());
  EXPECT_TRUE(film.albedo().empty());
  EXPECT_TRUE(film.normal().empty());
  EXPECT_TRUE(film.depth().empty());
  EXPECT_EQ(film.beauty().size(), 18u);
}

}  // namespace
}  // namespace wavecomb
