// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/render/passes/allotment.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <random>

namespace wavecomb {
namespace {

Settings allocated(uint32_t size, uint32_t spp, Allocate how = Allocate::kError) {
  Settings s;
  s.width = s.height = size;
  s.spp = spp;
  s.allocate = how;
  return s;
}

/// Adds `n` samples with values from `sample()` to a pixel. If the film stores costs, adds `cost`
/// for each sample.
void add(Film& film, uint32_t x, uint32_t y, uint32_t n, float cost, const auto& sample) {
  Film::Pixel& p = film.pixel(x, y);
  for (uint32_t i = 0; i < n; ++i) {
    const float v = sample();
    const float rgb[3] = {v, v, v};
    film.error(x, y).add(rgb, p.samples, {p.r, p.g, p.b});
    p.r += v;
    p.g += v;
    p.b += v;
    ++p.samples;
    if (double* sum = film.aovs().sums(Aov::kCost, film.index(x, y))) *sum += cost;
  }
}

Film film_of(const Settings& s) {
  const uint32_t set = s.allocate == Allocate::kEfficiency ? static_cast<uint32_t>(Aov::kCost) : 0;
  return Film(s.width, s.height, {AovSet{set}}, true);
}

uint64_t total(const SampleAllocation& a) {
  return std::accumulate(a.counts.begin(), a.counts.end(), uint64_t{0});
}

TEST(SampleAllocation, GivesOutTheBudgetExactly) {
  for (const uint32_t spp : {16u, 17u, 50u, 64u, 100u, 1000u, 1u << 20}) {
    for (const uint32_t size : {1u, 2u, 13u, 32u}) {
      const Settings s = allocated(size, spp);
      Film film = film_of(s);
      std::mt19937 rng(spp + size);
      std::exponential_distribution<float> light;
      for (uint32_t y = 0; y < size; ++y)
        for (uint32_t x = 0; x < size; ++x)
          add(film, x, y, pilot_samples(s), 1, [&] { return x < size / 2 ? 1.f : light(rng); });
      AllocationStatistics facts;
      const SampleAllocation a = allocate_samples(film, s, facts);
      EXPECT_EQ(total(a), uint64_t{spp} * size * size) << spp << " " << size;
      EXPECT_GE(facts.least, facts.pilot);
      EXPECT_EQ(facts.most, *std::max_element(a.counts.begin(), a.counts.end()));
      // The sample counts of pixels never decrease from pass to pass and end at the allotted
      // counts.
      for (size_t i = 0; i < a.counts.size(); ++i) {
        EXPECT_EQ(a.at(i, a.spp), a.counts[i]);
        EXPECT_EQ(a.at(i, a.pilot), a.pilot);
        EXPECT_LE(a.at(i, a.pilot + 1), a.at(i, std::min(a.spp, a.pilot + 5)));
      }
    }
  }
}

TEST(SampleAllocation, FollowsErrorAndCost) {
  // The film has four bands of 16 columns: low noise, high noise, high noise with 16 times the
  // cost, and low noise.
  const auto counts = [](Allocate how) {
    const Settings s = allocated(64, 256, how);
    Film film = film_of(s);
    std::mt19937 rng(5);
    std::gamma_distribution<float> quiet(100.f, 0.01f), noisy(1.f, 1.f);
    for (uint32_t y = 0; y < 64; ++y)
      for (uint32_t x = 0; x < 64; ++x) {
        const bool is_noisy = x >= 16 && x < 48;
        add(film, x, y, pilot_samples(s), x >= 32 && x < 48 ? 16.f : 1.f,
            [&] { return is_noisy ? noisy(rng) : quiet(rng); });
      }
    AllocationStatistics facts;
    const SampleAllocation a = allocate_samples(film, s, facts);
    EXPECT_GT(facts.gain, 1.2);
    std::array<double, 4> mean{};
    for (uint32_t y = 0; y < 64; ++y)
      for (uint32_t x = 0; x < 64; ++x) mean[x / 16] += a.counts[y * 64 + x] / 1024.0;
    return mean;
  };
  const auto error = counts(Allocate::kError);
  EXPECT_GT(error[1], 4 * error[0]);
  EXPECT_NEAR(error[2] / error[1], 1, 0.05);
  const auto efficiency = counts(Allocate::kEfficiency);
  EXPECT_NEAR(efficiency[1] / efficiency[2], 4, 0.6);
}

TEST(SampleAllocation, BlackAndBrokenPixelsAreAsOthers) {
  const Settings s = allocated(16, 64);
  Film film = film_of(s);
  for (uint32_t y = 0; y < 16; ++y)
    for (uint32_t x = 0; x < 16; ++x)
      add(film, x, y, pilot_samples(s), 1, [&] { return y < 8 ? 0.f : std::nanf(""); });
  AllocationStatistics facts;
  const SampleAllocation a = allocate_samples(film, s, facts);
  EXPECT_EQ(total(a), 64u * 256u);
  EXPECT_GE(facts.least, 32u);
}

/// Returns the bias of the image mean in standard errors. Samples are 20 with probability 1/20 and
/// otherwise 0. `counts(film, settings)` returns the number of samples of each pixel.
double bias_z(const auto& counts) {
  constexpr uint32_t kSize = 24, kRounds = 300;
  std::mt19937 rng(11);
  std::bernoulli_distribution shines(0.05);
  const auto sample = [&] { return shines(rng) ? 20.f : 0.f; };
  double sum = 0, squares = 0;
  for (uint32_t round = 0; round < kRounds; ++round) {
    const Settings s = allocated(kSize, 32);
    Film film = film_of(s);
    for (uint32_t y = 0; y < kSize; ++y)
      for (uint32_t x = 0; x < kSize; ++x) add(film, x, y, pilot_samples(s), 1, sample);
    const std::vector<uint32_t> n = counts(film, s);
    double mean = 0;
    for (uint32_t y = 0; y < kSize; ++y)
      for (uint32_t x = 0; x < kSize; ++x) {
        add(film, x, y, n[film.index(x, y)] - pilot_samples(s), 1, sample);
        mean += film.pixel(x, y).r / n[film.index(x, y)] / (kSize * kSize);
      }
    sum += mean;
    squares += mean * mean;
  }
  const double mean = sum / kRounds, variance = squares / kRounds - mean * mean;
  return (mean - 1) / std::sqrt(variance / kRounds);
}

TEST(SampleAllocation, IsUnbiasedWhereSamplesAreSkewed) {
  EXPECT_LT(std::abs(bias_z([](Film& film, const Settings& s) {
              AllocationStatistics facts;
              return allocate_samples(film, s, facts).counts;
            })),
            3.5);
  // The test detects bias: it fails if the sample count of a pixel depends on its own samples.
  EXPECT_LT(bias_z([](Film& film, const Settings& s) {
              std::vector<uint32_t> n(film.pixel_count());
              for (size_t i = 0; i < n.size(); ++i) n[i] = film.pixel(i).r > 0 ? s.spp : 12;
              return n;
            }),
            -10);
}

TEST(SampleAllocation, SettingsThatCannotBe) {
  Settings s = allocated(16, 64);
  s.check();
  s.noise = 0.1f;
  EXPECT_ANY_THROW(s.check());
  s = allocated(16, 64);
  s.region = Region{0, 0, 8, 8};
  EXPECT_ANY_THROW(s.check());
  EXPECT_EQ(pilot_samples(allocated(16, 15)), 0u);
  EXPECT_EQ(pilot_samples(allocated(16, 64, Allocate::kEven)), 0u);
}

}  // namespace
}  // namespace wavecomb
