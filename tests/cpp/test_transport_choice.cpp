// SPDX-License-Identifier: Apache-2.0
// What Transport::kAuto makes of trials, and which scenes it does not try.
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "scene_testing.h"
#include "wavecomb/render/transport_choice.h"

namespace wavecomb {
namespace {

using namespace scene_testing;

constexpr uint32_t kSide = 32;
constexpr uint64_t kRays = 100'000, kRecords = 50'000;

/// A picture of brightness 1, and `light` more with light paths, whose parts have noise of these
/// deviations.
TransportTrial trial(uint32_t seed, float camera_noise, float light_noise, float light,
                     bool with_paths) {
  std::mt19937 rng(seed);
  std::normal_distribution<float> noise;
  TransportTrial out;
  out.rays = with_paths ? 2 * kRays : kRays;
  out.records = with_paths ? 2 * kRecords : kRecords;
  for (uint32_t i = 0; i < kSide * kSide; ++i) {
    const float camera = 1 + camera_noise * noise(rng);
    const float found = with_paths ? light + light_noise * noise(rng) : 0;
    for (int c = 0; c < 3; ++c) {
      out.beauty.push_back(camera + found);
      out.by_light_paths.push_back(found);
    }
  }
  return out;
}

TransportGain gain_of(float path_noise, float camera_noise, float light_noise, float light = 0) {
  const TransportTrial without[2] = {trial(1, path_noise, 0, 0, false),
                                     trial(2, path_noise, 0, 0, false)};
  const TransportTrial with[2] = {trial(3, camera_noise, light_noise, light, true),
                                  trial(4, camera_noise, light_noise, light, true)};
  return transport_gain(without, with, kSide, 8);
}

TEST(TransportGain, IsBelowOneWhereLightPathsBringNothing) {
  const TransportGain gain = gain_of(0.1f, 0.1f, 0.f);
  EXPECT_LT(gain.gain, 0.95);
  EXPECT_LT(gain.share.exponent, 0) << "as few as there may be";
}

TEST(TransportGain, IsTheRatioOfVariancesByCosts) {
  // As noisy parts: v 4, (1 + 1) at s = 1, and light paths cost what camera paths cost.
  const TransportGain gain = gain_of(0.2f, 0.1f, 0.1f);
  const double path = kRays + 0.7 * kRecords, joint = kRays + 1.2 * kRecords;
  EXPECT_EQ(gain.share.exponent, 0);
  EXPECT_NEAR(gain.gain, 4 * path / (2 * 2 * joint), 0.15);
}

TEST(TransportGain, AsksForManyLightPathsWhereTheyAreTheNoise) {
  EXPECT_EQ(gain_of(0.5f, 0.01f, 0.3f).share.exponent, 2);
  EXPECT_EQ(gain_of(0.5f, 0.3f, 0.01f).share.exponent, -2);
}

TEST(TransportGain, CountsLightThatCameraPathsDoNotFind) {
  EXPECT_LT(gain_of(0.05f, 0.05f, 0.05f).gain, 1);
  EXPECT_GT(gain_of(0.05f, 0.05f, 0.05f, 0.5f).gain, 20);
}

TEST(TransportGain, CountsLightThatIsLostInTheNoiseOfAPixel) {
  const double even = gain_of(0.05f, 0.05f, 0.5f).gain;
  EXPECT_GT(gain_of(0.05f, 0.05f, 0.5f, 0.15f).gain, 10 * even);
}

TEST(TransportGain, TakesNoNoiseForLight) {
  for (uint32_t seed = 0; seed < 400; seed += 4) {
    const TransportTrial without[2] = {trial(seed, 0.3f, 0, 0, false),
                                       trial(seed + 1, 0.3f, 0, 0, false)};
    const TransportTrial with[2] = {trial(seed + 2, 0.3f, 0.02f, 0, true),
                                    trial(seed + 3, 0.3f, 0.02f, 0, true)};
    EXPECT_LT(transport_gain(without, with, kSide, 1000).gain, 1) << seed;
  }
}

TEST(FocusesLight, ByItsMaterials) {
  const auto scene_of = [](const Material& material) {
    SceneBuilder b;
    const uint32_t id = b.add_material(material);
    b.add_to_group(0, b.add_mesh(make_mesh(quad({0, 0, 0}, {1, 0, 0}, {0, 1, 0}), id)));
    return b.build();
  };
  Material m;
  m.program = ProgramId::kDiffuse;
  m.roughness = 0;
  EXPECT_FALSE(focuses_light(*scene_of(m)));
  m.program = ProgramId::kDielectric;
  EXPECT_TRUE(focuses_light(*scene_of(m)));
  m.program = ProgramId::kPrincipled;
  EXPECT_TRUE(focuses_light(*scene_of(m)));
  m.roughness = 0.6f;
  EXPECT_FALSE(focuses_light(*scene_of(m)));
  m.clearcoat = 1;
  EXPECT_TRUE(focuses_light(*scene_of(m)));
  m.clearcoat = 0;
  m.opacity = 0.5f;
  EXPECT_TRUE(focuses_light(*scene_of(m)));
  m.presence = true;
  EXPECT_FALSE(focuses_light(*scene_of(m)));
}

}  // namespace
}  // namespace wavecomb
