// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/light_paths/render/light_path_plan.h"
#include "wavecomb/render/passes/adaptive.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>

namespace wavecomb {
namespace {

/// Adds samples to a pixel of a film, as waves do.
void add_samples(Film& film, uint32_t x, uint32_t y, uint32_t n, const auto& sample) {
  Film::Pixel& p = film.pixel(x, y);
  for (uint32_t i = 0; i < n; ++i) {
    float rgb[3];
    sample(rgb);
    film.error(x, y).add(rgb, p.samples, {p.r, p.g, p.b});
    p.r += rgb[0];
    p.g += rgb[1];
    p.b += rgb[2];
    ++p.samples;
  }
}

TEST(ErrorSums, HalfIsEvenBlocks) {
  constexpr uint32_t kBlock = ErrorSums::kHalfBlock;
  uint32_t in_half = 0;
  for (uint32_t n = 0; n < 10 * kBlock; ++n) {
    EXPECT_EQ(ErrorSums::half_count(n), in_half) << n;
    if (n / kBlock % 2 == 0) ++in_half;
  }
}

TEST(ErrorSums, VarianceIsTheTwoPassOne) {
  Film film(1, 1, {AovSet{0}}, true);
  std::mt19937 rng(3);
  std::exponential_distribution<float> light(0.5f);
  std::vector<double> seen;
  add_samples(film, 0, 0, 1000, [&](float* rgb) {
    // The mean is large compared with the noise, so naive sums would lose precision.
    rgb[0] = 1e4f + light(rng);
    rgb[1] = rgb[2] = 2;
    seen.push_back(rgb[0]);
  });
  double mean = 0, squares = 0;
  for (double x : seen) mean += x / 1000;
  for (double x : seen) squares += (x - mean) * (x - mean);
  const std::vector<float> variance = film.variance();
  EXPECT_NEAR(variance[0], squares / (1000.0 * 999.0), 1e-6 * squares / 1e6);
  EXPECT_NEAR(variance[1], 0, 1e-12);
}

TEST(ErrorSums, NoVarianceBelowTwoSamples) {
  Film film(1, 1, {AovSet{0}}, true);
  EXPECT_EQ(film.variance()[0], std::numeric_limits<float>::infinity());
  EXPECT_TRUE(Film(1, 1, {AovSet{0}}).variance().empty());
}

/// Makes a film of `size` x `size` pixels with mean 1 and noise of standard deviation `sigma(x, y)`
/// per sample. Samples have a gamma distribution, which is skewed and never negative, like
/// radiance.
Film noisy_film(uint32_t size, uint32_t samples, const auto& sigma, uint32_t seed = 1) {
  Film film(size, size, {AovSet{0}}, true);
  std::mt19937 rng(seed);
  for (uint32_t y = 0; y < size; ++y)
    for (uint32_t x = 0; x < size; ++x) {
      const float v = sigma(x, y) * sigma(x, y);
      std::gamma_distribution<float> light(v > 0 ? 1 / v : 1, v > 0 ? v : 1);
      add_samples(film, x, y, samples, [&](float* rgb) {
        for (int c = 0; c < 3; ++c) rgb[c] = v > 0 ? light(rng) : 1;
      });
    }
  return film;
}

TEST(ErrorMap, IsTheTrueErrorOnAverage) {
  for (const uint32_t samples : {16u, 40u, 256u}) {
    const Film film = noisy_film(64, samples, [](uint32_t, uint32_t) { return 0.5f; });
    const std::vector<float> beauty = film.beauty();
    double truth = 0, e = 0;
    for (size_t i = 0; i < 64 * 64; ++i) {
      double light = 0, difference = 0;
      for (size_t c = 0; c < 3; ++c) {
        light += beauty[3 * i + c];
        difference += std::abs(beauty[3 * i + c] - 1.0);
      }
      truth += difference / (3 * 64 * 64);
      e += difference / std::sqrt(light) / (64 * 64);
    }
    const ErrorMap map = measure_error(film);
    double mean = 0;
    for (float x : map.error) mean += x / (64 * 64);
    EXPECT_NEAR(map.mean_relative / truth, 1, 0.05) << samples;
    EXPECT_NEAR(mean / e, 1, 0.05) << samples;
    EXPECT_NEAR(map.even_error, std::sqrt(3.0), 0.02);
  }
}

TEST(ErrorMap, IsUnknownBelowTwoBlocks) {
  for (const uint32_t samples : {8u, 9u, 15u})
    EXPECT_EQ(measure_error(noisy_film(4, samples, [](auto, auto) { return 0.5f; })).error[0],
              std::numeric_limits<float>::infinity())
        << samples;
}

TEST(ErrorMap, FollowsTheNoise) {
  const Film film = noisy_film(64, 64, [](uint32_t x, uint32_t) { return x < 32 ? 0.1f : 0.8f; });
  const ErrorMap map = measure_error(film);
  const auto expected = [](double sigma) {  // mean of |normal|: sqrt(2 / pi) sigma
    return 3 * 0.7979 * sigma / std::sqrt(64.0) / std::sqrt(3.0);
  };
  uint32_t off = 0;
  for (uint32_t y = 0; y < 64; ++y)
    for (uint32_t x = 0; x < 64; ++x) {
      if (x >= 30 && x < 34) continue;
      const double ratio = map.error[y * 64 + x] / expected(x < 32 ? 0.1 : 0.8);
      off += ratio < 0.6 || ratio > 1.6;
    }
  EXPECT_LT(off, 20u) << "of 3840 pixels; the window makes a stable estimate of few samples";
}

TEST(ErrorMap, UnknownAndBrokenPixels) {
  Film film(12, 1, {AovSet{0}}, true);
  const auto broken = [](float* rgb) {
    rgb[0] = rgb[1] = rgb[2] = std::numeric_limits<float>::quiet_NaN();
  };
  add_samples(film, 0, 0, 16, broken);
  const ErrorMap map = measure_error(film);
  for (uint32_t x = 0; x < 12; ++x)
    EXPECT_EQ(map.error[x], x <= kErrorWindow ? 0 : std::numeric_limits<float>::infinity()) << x;
  EXPECT_EQ(map.mean_relative, 0) << "a pixel that no sample can mend asks for none";
  EXPECT_EQ(measure_error(Film(2, 2, {AovSet{0}}, true)).mean_relative,
            std::numeric_limits<double>::infinity());
}

AdaptiveCheck check(const Film& film, const Settings& settings) {
  const PassRules rules{settings.spp, settings.min_spp, true, false, 16};
  return check_adaptive(measure_error(film), film.window(), film.samples(), settings, rules);
}

TEST(Adaptive, NoisyPixelsAndTheirNeighboursGoOn) {
  Settings settings;
  settings.spp = 1024;
  settings.adaptive = 5e-4f;
  Film film =
      noisy_film(32, 64, [](uint32_t x, uint32_t y) { return x == 16 && y == 16 ? 1.f : 0.f; });
  AdaptiveCheck c = check(film, settings);
  const uint32_t reach = kErrorWindow + kDilation;
  for (uint32_t y = 0; y < 32; ++y)
    for (uint32_t x = 0; x < 32; ++x) {
      const bool near = std::max(std::abs(int(x) - 16), std::abs(int(y) - 16)) <= int(reach);
      EXPECT_EQ(c.active[y * 32 + x] != 0, near) << x << ", " << y;
    }
  EXPECT_EQ(c.active_count, (2 * reach + 1) * (2 * reach + 1));
  EXPECT_GT(c.expected_samples, 32u * 32 * 64);
  // A pixel that has the maximum number of samples is finished, even if it is noisy.
  film.pixel(16, 16).samples = 1024;
  EXPECT_EQ(check(film, settings).active[16 * 32 + 16], 0);
}

TEST(Adaptive, NoNoiseNoMore) {
  Settings settings;
  settings.spp = 1024;
  for (const bool target : {false, true}) {
    (target ? settings.noise : settings.adaptive) = 1e-4f;
    (target ? settings.adaptive : settings.noise) = 0;
    const AdaptiveCheck c = check(noisy_film(8, 16, [](auto, auto) { return 0.f; }), settings);
    EXPECT_EQ(c.active_count, 0u);
    EXPECT_EQ(c.expected_samples, 8u * 8 * 16);
  }
}

TEST(Adaptive, NoiseTargetEndsByTheMean) {
  const Film film = noisy_film(32, 64, [](uint32_t x, uint32_t) { return x < 16 ? 0.05f : 0.8f; });
  const double mean = measure_error(film).mean_relative;
  Settings settings;
  settings.spp = 1 << 20;
  settings.noise = static_cast<float>(1.01 * mean);
  EXPECT_EQ(check(film, settings).active_count, 0u);
  settings.noise = static_cast<float>(0.99 * mean);
  const AdaptiveCheck c = check(film, settings);
  EXPECT_GT(c.active_count, 32u * 13);
  EXPECT_LT(c.active_count, 32u * 24) << "the quiet half does not go on";
  // An image twice as bright with the same relative noise has the same active pixels.
  Film bright(32, 32, {AovSet{0}}, true);
  for (uint32_t y = 0; y < 32; ++y)
    for (uint32_t x = 0; x < 32; ++x) {
      const Film::Pixel p = film.pixel(size_t{y} * 32 + x);
      bright.pixel(x, y) = {2 * p.r, 2 * p.g, 2 * p.b, p.samples};
      bright.error(x, y) = film.error(size_t{y} * 32 + x);
      for (double& h : bright.error(x, y).half) h *= 2;
    }
  EXPECT_EQ(check(bright, settings).active, c.active);
}

TEST(Adaptive, NoiseTargetIsMetByPicturesOfFewBrightPixels) {
  // Tests isolated bright pixels. The window spreads the error of each bright pixel over 25 pixels,
  // so these pixels reach the threshold long before the image as a whole.
  const auto is_star = [](uint32_t x, uint32_t y) { return x % 16 == 8 && y % 16 == 8; };
  std::mt19937 rng(7);
  Film film(32, 32, {AovSet{0}}, true);
  for (uint32_t y = 0; y < 32; ++y)
    for (uint32_t x = 0; x < 32; ++x) {
      std::gamma_distribution<float> light(1.f, is_star(x, y) ? 100.f : 0.f);
      add_samples(film, x, y, 64, [&](float* rgb) {
        for (int c = 0; c < 3; ++c) rgb[c] = is_star(x, y) ? light(rng) : 0.001f;
      });
    }
  const ErrorMap map = measure_error(film);
  Settings settings;
  settings.spp = 1 << 20;
  settings.noise = static_cast<float>(0.5 * map.mean_relative);
  const float worst = *std::max_element(map.error.begin(), map.error.end());
  ASSERT_LT(worst, settings.noise * map.even_error) << "or it would show nothing";
  const AdaptiveCheck c = check(film, settings);
  EXPECT_GT(c.active_count, 0u) << "the picture's error is twice what it may be";
  EXPECT_LT(c.active_count, 4u * 81 + 1) << "stars and their windows only";
}

/// Tests pixels whose camera samples have no noise but which receive light splats: the error comes
/// from the half buffers of the splats.
TEST(ErrorMap, SeesTheNoiseOfSplats) {
  constexpr uint32_t kSize = 24, kSamples = 64, kPaths = kSize * kSize;
  std::mt19937 rng(7);
  std::exponential_distribution<float> brightness;
  double told = 0, known = 0;
  for (int round = 0; round < 4; ++round) {
    Film film(kSize, kSize, {AovSet{0}}, true);
    film.allocate_light_splats({-20}, kPaths);
    for (uint32_t i = 0; i < kPaths; ++i)
      add_samples(film, i % kSize, i / kSize, 16, [](float* rgb) { rgb[0] = rgb[1] = rgb[2] = 1; });
    LightSplatList list(1);
    for (uint32_t sample = 0; sample < kSamples; ++sample)
      for (uint32_t path = 0; path < kPaths; ++path) {
        const float c = 2 * brightness(rng);
        ASSERT_TRUE(list.add(
            {static_cast<uint32_t>(rng() % kPaths), c, c, c, LightSplatLayer::is_in_half(sample)}));
        film.splats().add(list);
        list.clear();
      }
    for (uint32_t path = 0; path < kPaths; ++path) film.splats().done(path, 0, kSamples);
    const double expected = 3;
    double error = 0, light = 0;
    for (size_t i = 0; i < kPaths; ++i) {
      error += std::abs(1 + film.splats().mean(i)[0] - expected);
      light += expected;
    }
    told += measure_error(film).mean_relative;
    known += error / light;
    EXPECT_EQ(measure_noise_parts(film, {}).own, 0);
    EXPECT_GT(measure_noise_parts(film, {}).splats, 0);
    EXPECT_GT(film.variance()[0], 0);
  }
  EXPECT_NEAR(told, known, 0.1 * known);
}

TEST(Adaptive, LightPathsGoOnAsFarAsTheirNoiseDecides) {
  // All pixels are active, and light splats and camera samples have equal noise after 16 samples
  // each. Then light paths and camera paths get equal numbers of samples.
  EXPECT_EQ(light_samples_after({1, 1}, 16, 16, 64, 64, 1.0), 64u);
  // If only 1/16 of the pixels are active, a light path sample costs 16 times as much relative to a
  // camera sample.
  EXPECT_EQ(light_samples_after({1, 1}, 16, 16, 64, 64, 1.0 / 16), 16u);
  EXPECT_EQ(light_samples_after({1, 4}, 16, 16, 64, 64, 1.0 / 16), 32u);
  // The new number of light path samples is at least the current number and at most the limit.
  EXPECT_EQ(light_samples_after({1, 100}, 16, 16, 64, 64, 1.0), 64u);
  EXPECT_EQ(light_samples_after({100, 1}, 16, 16, 64, 64, 1e-3), 16u);
  EXPECT_EQ(light_samples_after({0, 0}, 16, 16, 64, 64, 1.0), 16u);
  EXPECT_EQ(light_samples_after({0, 1}, 16, 16, 64, 64, 1.0), 64u);
  // Without half buffers, the noise of light splats is unknown.
  EXPECT_EQ(light_samples_after({1, 0}, 1, 4, 16, 4, 1.0), 4u);
}

}  // namespace
}  // namespace wavecomb
