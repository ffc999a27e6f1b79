// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/film/deep_film.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>

#include "wavecomb/core/error.h"

namespace wavecomb {
namespace {

struct DeepSample {
  float z;
  bool in_volume;
  float rgb[3];
};

DeepLayer layer_of(const std::vector<DeepSample>& samples, uint32_t all, const DeepLimits& limits) {
  DeepFilm film(1, limits);
  for (const DeepSample& s : samples) film.add(0, s.z, s.in_volume, s.rgb);
  return film.layer({all});
}

/// Composites R, G, B and A of all deep samples of a pixel.
std::array<double, 4> flattened(const DeepLayer& layer) {
  std::array<double, 4> out{};
  for (uint32_t i = 0; i < layer.counts[0]; ++i) {
    const float* v = layer.values.data() + i * DeepLayer::kChannels;
    const double free = 1 - out[3];
    for (size_t c = 0; c < 4; ++c) out[c] += free * double{v[c]};
  }
  return out;
}

TEST(DeepFilm, SamplesAtOneDepthAreOne) {
  const DeepLayer layer =
      layer_of({{2.f, false, {1, 0, 0}}, {2.01f, false, {3, 0, 0}}}, 4, {8, 0.01f});
  ASSERT_EQ(layer.counts[0], 1u);
  EXPECT_FLOAT_EQ(layer.values[0], 1.f);   // (1 + 3) / 4
  EXPECT_FLOAT_EQ(layer.values[3], 0.5f);  // two of four
  EXPECT_FLOAT_EQ(layer.values[4], 2.005f);
  EXPECT_FLOAT_EQ(layer.values[5], 2.005f);
}

TEST(DeepFilm, WhatIsBehindHasWhatTheFrontLeaves) {
  const DeepLayer layer =
      layer_of({{5.f, false, {2, 2, 2}}, {1.f, false, {1, 1, 1}}}, 4, {8, 0.01f});
  ASSERT_EQ(layer.counts[0], 2u);
  EXPECT_FLOAT_EQ(layer.values[3], 0.25f);
  EXPECT_FLOAT_EQ(layer.values[4], 1.f);
  EXPECT_FLOAT_EQ(layer.values[6 + 3], 1.f / 3);
  EXPECT_FLOAT_EQ(layer.values[6 + 0], 2.f / 3);
}

TEST(DeepFilm, AVolumeHasAFrontAndABack) {
  const DeepLayer layer =
      layer_of({{2.f, true, {1, 1, 1}}, {2.015f, true, {1, 1, 1}}}, 2, {8, 0.01f});
  ASSERT_EQ(layer.counts[0], 1u);
  EXPECT_FLOAT_EQ(layer.values[4], 2.f);
  EXPECT_FLOAT_EQ(layer.values[5], 2.015f);
  EXPECT_FLOAT_EQ(layer.values[3], 1.f);
}

TEST(DeepFilm, AnyNumberOfSamplesFlattensToTheirSum) {
  std::mt19937 rng(7);
  std::uniform_real_distribution<float> depth(1, 100), light(0, 3);
  for (const uint32_t most : {1u, 2u, 5u, 64u}) {
    std::vector<DeepSample> samples;
    double r = 0;
    for (int i = 0; i < 300; ++i) {
      samples.push_back({depth(rng), i % 3 == 0, {light(rng), light(rng), light(rng)}});
      r += double{samples.back().rgb[0]};
    }
    const DeepLayer layer = layer_of(samples, 500, {most, 0.001f});
    EXPECT_LE(layer.counts[0], most);
    if (most == 64) {
      EXPECT_EQ(layer.counts[0], most);
    }
    const auto flat = flattened(layer);
    EXPECT_NEAR(flat[0], r / 500, 1e-5 * r / 500);
    EXPECT_NEAR(flat[3], 300. / 500, 1e-5);
    float before = 0;
    for (uint32_t i = 0; i < layer.counts[0]; ++i) {
      const float* v = layer.values.data() + i * DeepLayer::kChannels;
      EXPECT_GT(v[4], before);
      EXPECT_GE(v[5], v[4]);
      before = v[5];
    }
  }
}

TEST(DeepFilm, BinsAreNoWiderThanTheTolerance) {
  std::mt19937 rng(3);
  std::uniform_real_distribution<float> depth(10, 12);
  std::vector<DeepSample> samples;
  for (int i = 0; i < 200; ++i) samples.push_back({depth(rng), true, {1, 1, 1}});
  const DeepLayer layer = layer_of(samples, 200, {64, 0.02f});
  for (uint32_t i = 0; i < layer.counts[0]; ++i) {
    const float* v = layer.values.data() + i * DeepLayer::kChannels;
    EXPECT_LE(v[5] - v[4], 0.02f * v[5] * 1.0001f);
  }
}

TEST(DeepFilm, MemoryIsBounded) {
  const DeepFilm film(1000, {16, 0.01f});
  EXPECT_EQ(sizeof(DeepBin), 40u);
  EXPECT_EQ(film.bytes(), 1000u * (1 + 16 * 40));
}

TEST(DeepFilm, GoesOnFromWhatWasPacked) {
  std::mt19937 random(4);
  const auto add = [&](DeepFilm& film, int count) {
    std::uniform_real_distribution<float> depth(1, 9);
    for (int i = 0; i < count; ++i) {
      const float rgb[3] = {depth(random), 1, 2};
      film.add(random() % 3, depth(random), i % 5 == 0, rgb);
    }
  };
  const DeepLimits limits{4, 0.05f};
  DeepFilm whole(3, limits), resumed(3, limits);
  add(whole, 30);
  resumed.unpack(whole.packed());
  EXPECT_EQ(resumed.packed(), whole.packed());
  const std::mt19937 before = random;
  add(whole, 30);
  random = before;
  add(resumed, 30);
  EXPECT_EQ(resumed.packed(), whole.packed());
  EXPECT_EQ(resumed.layer({60, 60, 60}).values, whole.layer({60, 60, 60}).values);
}

TEST(DeepFilm, RefusesWhatIsOfAnotherPicture) {
  DeepFilm film(2, {4, 0.05f});
  const float rgb[3] = {1, 1, 1};
  film.add(0, 1.f, false, rgb);
  std::vector<std::byte> bytes = film.packed();
  DeepFilm other(2, {4, 0.05f}), larger(200, {4, 0.05f});
  EXPECT_THROW(larger.unpack(bytes), Error);
  EXPECT_THROW(other.unpack({}), Error);
  bytes[1] = std::byte{1};
  EXPECT_THROW(other.unpack(bytes), Error);
  bytes[1] = std::byte{9};  // more than fit
  bytes.resize(bytes.size() + 9 * sizeof(DeepBin));
  EXPECT_THROW(other.unpack(bytes), Error);
}

}  // namespace
}  // namespace wavecomb
