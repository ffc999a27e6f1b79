// SPDX-License-Identifier: Apache-2.0
// Decisions of Transport::kAuto from pilot renders, and scenes for which no pilot is rendered.
#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <utility>

#include "scene_testing.h"
#include "wavecomb/light_paths/render/transport_choice.h"
#include "wavecomb/light_paths/setup.h"
#include "wavecomb/render/renderer.h"
#include "wavecomb/render/snapshot.h"
#include "wavecomb/render/statistics/render_statistics.h"
#include "wavecomb/scene/scene.h"

namespace wavecomb {
namespace {

using namespace scene_testing;

constexpr uint32_t kSide = 32;
constexpr uint64_t kRays = 100'000, kRecords = 50'000;

/// Makes a pilot render of brightness 1 plus `light` found by light paths, with the given standard
/// deviations of noise. Light paths cost the same as camera paths.
TransportPilot pilot(uint32_t seed, LightPathShare share, float camera_noise, float light_noise,
                     float light) {
  std::mt19937 rng(seed);
  std::normal_distribution<float> noise;
  TransportPilot out;
  out.work = {kRays * (1.0 + share.paths()), kRecords * (1.0 + share.paths())};
  for (uint32_t i = 0; i < kSide * kSide; ++i) {
    const float camera = 1 + camera_noise * noise(rng);
    const float found = light + light_noise / std::sqrt(share.paths()) * noise(rng);
    for (int c = 0; c < 3; ++c) {
      out.beauty.push_back(camera + found);
      out.by_light_paths.push_back(found);
    }
  }
  return out;
}

/// Makes pilots for all ratios. `left` is the standard deviation, over eight samples of a pixel, of
/// the light that light paths find.
TransportPilots trials_of(float left, float camera_noise, float light_noise, float light) {
  TransportPilots pilots;
  for (size_t k = 0; k < kCandidateShares.size(); ++k)
    for (uint32_t seed = 0; seed < 2; ++seed)
      pilots.with[k][seed] = pilot(2 * static_cast<uint32_t>(k) + seed, kCandidateShares[k],
                                   camera_noise, light_noise, light);
  for (uint32_t seed = 0; seed < 2; ++seed)
    pilots.path[seed] = pilot(10 + seed, LightPathShare{}, camera_noise, 0, 0);
  for (TransportPilot& t : pilots.path) t.work = {kRays, kRecords};
  pilots.variance.assign(kSide * kSide, 8.0 * left * left);
  pilots.width = kSide;
  return pilots;
}

TransportGain gain_of(float left, float camera_noise, float light_noise, float light = 1,
                      double longer = 8) {
  const TransportPilots pilots = trials_of(left, camera_noise, light_noise, light);
  return transport_gain(pilots, longer);
}

TEST(TransportGain, IsBelowOneWhereLightPathsBringNothing) {
  const TransportGain gain = gain_of(0.f, 0.1f, 0.f);
  EXPECT_LT(gain.gain, 0.95);
  EXPECT_LT(gain.share.exponent, 0) << "as few as there may be";
}

TEST(TransportGain, IsTheRatioOfVariancesByCosts) {
  // Adds the variance of camera paths to that of the remaining light: 1 + 3 without light paths,
  // and 1 + 1 with one light path per camera path.
  const TransportGain gain = gain_of(0.1f * std::sqrt(3.f), 0.1f, 0.1f);
  const double path = kRays + 0.7 * kRecords;
  const double with_light = 2 * kRays + (0.8 + 1.5) * kRecords;
  EXPECT_EQ(gain.share.exponent, 0);
  EXPECT_NEAR(gain.gain, 4 * path / (2 * with_light), 0.15);
}

TEST(TransportGain, CountsNoiseInFewPixelsLess) {
  // Light paths remove noise of camera paths in a few of 1,024 pixels, 100 times that of the rest.
  TransportPilots pilots = trials_of(0.f, 0.1f, 0.f, 1);
  const double most = transport_gain(pilots, 8).gain;
  EXPECT_LT(most, 1);
  const double rest = kSide * kSide * 0.01;
  const auto with_noise_in = [&](uint32_t count) {
    TransportPilots noisy = pilots;
    const float difference = std::sqrt(2 * 100 * static_cast<float>(rest) / count);
    for (uint32_t i = 0; i < count; ++i)
      for (size_t c = 0; c < 3; ++c) noisy.path[0].beauty[size_t{3} * 97 * i + c] += difference;
    return transport_gain(noisy, 8).gain;
  };
  EXPECT_NEAR(with_noise_in(1), most * std::pow(101, 1.0 / 11), 0.1 * most);
  EXPECT_NEAR(with_noise_in(10), most * std::pow(101, 0.5), 0.5 * most);
}

TEST(TransportGain, IsPredictedFromFewerLightPaths) {
  for (const auto& [camera, light] : {std::pair{0.1f, 0.1f}, {0.01f, 0.3f}, {0.3f, 0.01f}}) {
    TransportPilots pilots = trials_of(0.2f, camera, light, 1);
    const double known = transport_gain(pilots, 8).gain;
    for (TransportPilot& t : pilots.with[1]) t = {};
    EXPECT_NEAR(possible_gain(pilots, 8), known, 0.33 * known);
  }
}

TEST(TransportGain, SeparatesThePartOfCameraPaths) {
  // Light paths have the variance 0.01 / share, and as many rays and vertices as camera paths.
  constexpr double kCamera = kRays + 0.8 * kRecords, kLight = kRays + 1.5 * kRecords;
  const TransportGain many = gain_of(0.1f * std::sqrt(3.f), 0.1f, 0.1f);
  EXPECT_EQ(many.share.exponent, 0);
  EXPECT_NEAR(many.camera.error, 0.5, 0.05);
  EXPECT_NEAR(many.camera.cost, kCamera / (kCamera + kLight), 1e-6);
  const TransportGain few = gain_of(0.5f, 0.3f, 0.01f);
  EXPECT_EQ(few.share.exponent, -3);
  EXPECT_NEAR(few.camera.error, 1 / (1 + 8 * 0.01 * 0.01 / (0.3 * 0.3)), 0.02);
  EXPECT_NEAR(few.camera.cost, kCamera / (kCamera + kLight / 8), 1e-6);
}

TEST(CameraPathPart, DilutesWhatGuidingGains) {
  const CameraPathPart whole, half = {0.5, 0.5};
  EXPECT_DOUBLE_EQ(whole.gain(0.25, 1.6), 1 / (0.25 * 1.6));
  EXPECT_DOUBLE_EQ(half.gain(0.5, 1.5), 1 / (0.75 * 1.25));
  EXPECT_DOUBLE_EQ(half.gain(1, 1), 1);
}

TEST(TransportGain, CountsNoiseOfMissedLightOnly) {
  // Camera paths find a part of the light, and light paths all of it.
  const auto with_found = [](float part) {
    TransportPilots pilots = trials_of(0.3f, 0.05f, 0.05f, 1);
    for (TransportPilot& t : pilots.path)
      for (float& v : t.beauty) v += part;
    EXPECT_NEAR(missed_light(pilots), std::max(0.f, 1 - part), 0.01);
    return transport_gain(pilots, 8).gain;
  };
  EXPECT_GT(with_found(0), 5);
  EXPECT_NEAR(with_found(0.5f), 0.5 * with_found(0), 0.05 * with_found(0));
  EXPECT_LT(with_found(1), 1);
  EXPECT_LT(with_found(1.1f), 1);
}

TEST(TransportGain, CountsWhatMergingCosts) {
  TransportPilots pilots = trials_of(0.1f, 0.1f, 0.1f, 1);
  const double gain = transport_gain(pilots, 8).gain;
  pilots.merges = true;
  EXPECT_LT(transport_gain(pilots, 8).gain, 0.97 * gain);
}

TEST(TransportGain, MergesWhereOnlyMergingFindsLight) {
  // Pilots with merging have one ratio only.
  const TransportPilots unmerged = trials_of(0.1f, 0.1f, 0.1f, 1);
  const TransportGain plain = transport_gain(unmerged, 8);
  const auto gain_with = [&](float left) {
    TransportPilots merged = trials_of(left, 0.1f, 0.1f, 1);
    for (TransportPilot& t : merged.with[0]) t = {};
    merged.merges = true;
    const TransportGain gain = transport_gain(merged, 8);
    EXPECT_EQ(gain.share.exponent, kCandidateShares.back().exponent);
    return merging_gain(gain, plain);
  };
  EXPECT_LT(gain_with(0.1f), 1) << "nothing is hidden, and merging costs time";
  // Without merging, 0.02 with light paths at 315,000, and 0.26 - 0.02 hidden at 135,000.
  const double merged_cost = 315'000 + 8 * kSide * kSide + kRecords;
  const double expected = (0.02 * 315'000 + 0.24 * 135'000) / (0.02 * merged_cost);
  EXPECT_NEAR(gain_with(0.5f), expected, 0.1 * expected);
  EXPECT_GT(gain_with(0.5f), gain_with(0.3f));
}

TEST(TransportGain, TakesManyLightPathsWhereTheyAreTheNoise) {
  EXPECT_EQ(gain_of(0.5f, 0.01f, 0.3f).share.exponent, 0);
  EXPECT_EQ(gain_of(0.5f, 0.3f, 0.01f).share.exponent, -3);
}

TEST(TransportGain, LooksPastTheNoisiestPixels) {
  const auto with_dots = [](uint32_t dots) {
    TransportPilots pilots = trials_of(0.3f, 0.05f, 0.05f, 0.5f);
    for (auto* pair : {&pilots.path, &pilots.with[0], &pilots.with[1]})
      for (uint32_t seed = 0; seed < 2; ++seed)
        for (uint32_t i = 0; i < dots; ++i) (*pair)[seed].beauty[3 * (i * 97 + seed)] += 500;
    return transport_gain(pilots, 8).gain;
  };
  EXPECT_GT(with_dots(0), 3);
  // Six of 1,024 pixels are as noisy with light paths as without. Their ratio is that of the costs.
  const double expected = std::pow(135.0 / 315, 6.0 / 16) * std::pow(with_dots(0), 10.0 / 16);
  EXPECT_NEAR(with_dots(3), expected, 0.25 * expected);
  EXPECT_LT(with_dots(10), 1.2) << "and twenty are too many";
}

TEST(TransportGain, CountsLightThatCameraPathsDoNotFind) {
  EXPECT_LT(gain_of(0.05f, 0.05f, 0.05f).gain, 1);
  const TransportGain never = gain_of(1e6f, 0.05f, 0.05f, 0.5f);
  EXPECT_GT(never.gain, 20);
  EXPECT_LT(gain_of(1e6f, 0.05f, 0.05f, 0.5f, 1).gain, never.gain) << "no more than there is";
  EXPECT_LT(gain_of(1e6f, 0.05f, 0.f, 0.001f).gain, 1) << "and this is hardly seen";
}

/// Compares the noise of camera paths as estimated from light paths with the actual noise.
TEST(CameraSquares, AreTheVarianceOfCameraPaths) {
  // A light in the floor illuminates a rough mirror above, which reflects onto the floor.
  SceneBuilder b;
  const uint32_t floor = b.add_material(make_material(ProgramId::kDiffuse, {0.7f, 0.7f, 0.7f}));
  const uint32_t metal = b.add_material(make_material(ProgramId::kMetal, {0.9f, 0.9f, 0.9f}, 0.2f));
  b.add_to_group(0, b.add_mesh(make_mesh(ground(3), floor)));
  b.add_to_group(0, b.add_mesh(make_mesh(ground(3).transform(translate(0, 2, 0)), metal)));
  Light lamp =
      make_light(LightKind::kRect, {500, 500, 500}, translate(0, 0.05f, 0) * rotate(0, 90));
  lamp.width = lamp.height = 0.1f;
  b.add_light(lamp);
  b.set_camera(make_camera({0.8, 1.5, 0.8}, {0.8, 0, 0.7}, 0.5f));
  const ScenePtr scene = b.build();
  WavefrontRenderer renderer(scene);
  Settings s;
  s.width = s.height = 8;
  s.max_depth = 2;
  s.filter = FilterKind::kBox;
  s.sampler = SamplerKind::kIndependent;
  s.guiding = Guiding::kOff;
  s.spp = kSanitized ? 2048 : 32'768;
  s.error = true;
  const RenderedImage path = renderer.render(s);
  double known = 0;
  for (size_t i = 0; i < path.beauty.size(); ++i)
    known += double{path.variance[i]} * s.spp + double{path.beauty[i]} * double{path.beauty[i]};
  s.error = false;
  s.transport = Transport::kLight;
  s.aovs.bits = static_cast<uint32_t>(Aov::kByLightPaths);
  s.spp = 1024;
  RenderOptions options;
  options.wants_camera_squares = true;
  const RenderedImage told = renderer.render(s, options);
  double sum = 0;
  for (const float v : layer(told, "by_light_paths").values) sum += double{v};
  sum *= double{scene_brightness(*scene)};
  EXPECT_GT(sum, 0.8 * known) << "but for what camera paths find as well";
  EXPECT_LT(sum, 1.05 * known);
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
  m.opacity = 0.5f;  // light passes straight
  EXPECT_FALSE(focuses_light(*scene_of(m)));
}

}  // namespace
}  // namespace wavecomb
