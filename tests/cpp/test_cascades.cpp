// SPDX-License-Identifier: Apache-2.0
// Tests of cascaded outlier rejection, which must remove only rare bright samples.
#include <gtest/gtest.h>

#include <numeric>

#include "wavecomb/film/film.h"

namespace wavecomb {
namespace {

constexpr uint32_t kSide = 5, kMiddle = 12;

/// Makes a film of kSide x kSide pixels, each with `n` samples of brightness `y`.
Film even_film(uint32_t n, float y) {
  Film film(kSide, kSide, {AovSet{0}});
  film.allocate_cascades(1 / 64.f);
  const float rgb[3] = {y, y, y};
  for (uint32_t i = 0; i < kSide * kSide; ++i) {
    for (uint32_t s = 0; s < n; ++s) film.cascades().add(i, rgb);
    film.pixel(i % kSide, i / kSide) = {n * double{y}, n * double{y}, n * double{y}, n};
  }
  return film;
}

void add_sample(Film& film, uint32_t pixel, float r, float g, float b) {
  const float rgb[3] = {r, g, b};
  film.cascades().add(pixel, rgb);
  Film::Pixel& p = film.pixel(pixel % kSide, pixel / kSide);
  p = {p.r + double{r}, p.g + double{g}, p.b + double{b}, p.samples + 1};
}

TEST(Cascades, LeaveAnEvenPictureAsItIs) {
  for (const float y : {0.f, 1e-6f, 0.4f, 1.f, 7.9f, 300.f, 1e9f}) {
    const Film film = even_film(16, y);
    EXPECT_EQ(film.beauty(), film.unbiased()) << y;
  }
}

TEST(Cascades, TakeAwayTheOneSampleThatNobodyHasBeside) {
  Film film = even_film(15, 1);
  add_sample(film, kMiddle, 4000, 2000, 0);
  const std::vector<float> beauty = film.beauty(), all = film.unbiased();
  EXPECT_GT(all[3 * kMiddle], 200.f);
  EXPECT_LT(beauty[3 * kMiddle], 1.5f);
  EXPECT_LT(beauty[3 * kMiddle + 1], 1.5f);
  EXPECT_EQ(beauty[3 * kMiddle + 2], 15 / 16.f);
  for (uint32_t i = 0; i < 3 * kSide * kSide; ++i) {
    if (i / 3 != kMiddle) {
      EXPECT_EQ(beauty[i], all[i]) << i;
    }
  }
}

TEST(Cascades, TrustWhatManySamplesSay) {
  // In every pixel, one sample in eight is bright, so bright samples belong to the true image.
  Film film = even_film(56, 1);
  for (uint32_t i = 0; i < kSide * kSide; ++i)
    for (uint32_t s = 0; s < 8; ++s) add_sample(film, i, 500, 500, 500);
  EXPECT_EQ(film.beauty(), film.unbiased());
}

TEST(Cascades, TakeNothingThatChangesAPixelLittle) {
  Film film = even_film(1023, 1);
  add_sample(film, kMiddle, 60, 60, 60);
  EXPECT_EQ(film.beauty(), film.unbiased());
}

TEST(Cascades, AreWithoutBiasInTheLimit) {
  double last = 1e9;
  for (const uint32_t n : {16u, 128u, 1024u, 8192u}) {
    Film film = even_film(n - n / 16, 1);
    for (uint32_t s = 0; s < n / 16; ++s) add_sample(film, kMiddle, 900, 900, 900);
    const double lost = film.unbiased()[3 * kMiddle] - film.beauty()[3 * kMiddle];
    EXPECT_LE(lost, last);
    last = lost;
  }
  EXPECT_EQ(last, 0);
}

TEST(Cascades, ScaleWithTheLight) {
  for (const float scale : {0x1p-20f, 0x1p20f}) {
    Film one = even_film(7, 0.5f), other(kSide, kSide, {AovSet{0}});
    other.allocate_cascades(scale / 64.f);
    add_sample(one, kMiddle, 700, 30, 2);
    for (uint32_t i = 0; i < kSide * kSide; ++i)
      for (uint32_t s = 0; s < 7; ++s)
        add_sample(other, i, 0.5f * scale, 0.5f * scale, 0.5f * scale);
    add_sample(other, kMiddle, 700 * scale, 30 * scale, 2 * scale);
    std::vector<float> scaled = one.beauty();
    for (float& v : scaled) v *= scale;
    EXPECT_EQ(other.beauty(), scaled) << scale;
  }
}

}  // namespace
}  // namespace wavecomb
