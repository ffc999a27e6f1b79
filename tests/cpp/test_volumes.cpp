// SPDX-License-Identifier: Apache-2.0
// Images of volumes.
#include "volume_testing.h"
#include "wave_testing.h"

namespace wavecomb {
namespace {

using namespace volume_testing;
using namespace wave_testing;

/// Smoke of a coarse random grid with colour and emission, over a floor, with a light and a dome,
/// and an overlapping coloured box. With `moves`, the smoke moves while the shutter is open.
std::shared_ptr<const Scene> smoky(bool moves) {
  SceneBuilder b;
  const uint32_t grey = b.add_material(make_material(ProgramId::kDiffuse, {0.6f, 0.5f, 0.4f}));
  const uint32_t glass = b.add_material(make_material(ProgramId::kDielectric, {1, 1, 1}));
  b.add_to_group(0, b.add_mesh(make_mesh(ground(30), grey)));
  b.add_to_group(0, b.add_mesh(make_mesh(sphere(8, true), glass)));
  std::mt19937 rng(5);
  std::uniform_real_distribution<float> value(0.f, 1.f);
  Volume smoke;
  smoke.name = "/smoke";
  smoke.density =
      between(make_grid(
                  19, [&](int, int, int) { return value(rng) < 0.5f ? 0.f : value(rng); }, 1, true),
              19, -1.2f, 1.2f);
  smoke.color = between(make_grid(
                            9, [](int x, int, int) { return 0.03f * static_cast<float>(x); }, 3),
                        9, -1.5f, 1.5f);
  smoke.glow =
      between(make_grid(9, [](int, int y, int) { return y == 4 ? 1.f : 0.f; }, 3), 9, -1, 1);
  smoke.to_world = translate(0, 1, 0);
  smoke.extinction = {2, 2, 2};
  smoke.albedo = {0.9f, 0.8f, 0.7f};
  smoke.emission = {0.3f, 0.2f, 0.1f};
  smoke.anisotropy = 0.6f;
  if (moves) {
    smoke.velocity = between(
        make_wind(16, [&](int, int,
                          int) { return Vec3<float>(value(rng), value(rng) - 0.5f, -value(rng)); }),
        16, -2, 2);
    smoke.seconds = {-0.3f, 0.6f};
  }
  b.add_volume(smoke);
  Volume box = make_box({-2, 0, -2}, {0.5f, 1.5f, 2}, {0.2f, 0.5f, 0.9f});
  box.anisotropy = -0.3f;
  b.add_volume(box);
  Light lamp = make_light(LightKind::kSphere, {9, 8, 7}, translate(1.5f, 2.5f, 1));
  lamp.radius = 0.2f;
  b.add_light(lamp);
  b.add_light(make_light(LightKind::kDome, {0.2f, 0.3f, 0.4f}));
  b.set_camera(make_camera({0, 1.5, 4}, {0, 0.8, 0}, 1.f));
  return b.build();
}

Settings volume_settings(uint32_t width, uint32_t height, uint32_t spp, uint32_t depth) {
  Settings s;
  s.width = width;
  s.height = height;
  s.spp = spp;
  s.max_depth = depth;
  s.filter = FilterKind::kBox;
  s.filter_width = 1;
  return s;
}

class OnePicture : public testing::TestWithParam<bool> {};
INSTANTIATE_TEST_SUITE_P(OfVolumes, OnePicture, testing::Bool());

TEST_P(OnePicture, WhateverRendersIt) {
  const auto scene = smoky(GetParam());
  const auto accel = std::make_shared<const EmbreeAccelerator>(scene, 1u);
  Settings s = volume_settings(13, 9, 5, 6);
  s.aovs.bits |= Aov::kDirect | Aov::kIndirect | Aov::kTransmittance | Aov::kHalfDepth |
                 Aov::kCryptoObject | Aov::kMaterialId;
  WaveRun reference(scene, {s}, accel);
  reference.all(64);
  const RenderedImage expected = reference.image();
  EXPECT_GT(mean_of(expected).mean, 0.01);
  for (const uint32_t lanes : lane_widths())
    for (const uint32_t wave_size : {48u, 4096u})
      for (const char* policy : {"none", "program", "material"}) {
        s.policy = policy;
        s.materialize = wave_size == 48 ? Materialize::kOff : Materialize::kOn;
        WaveRun run(scene, {s, lanes, accel->native_width()}, accel);
        run.all(wave_size);
        expect_same_image(expected, run.image(),
                          std::to_string(lanes) + " lanes, waves of " + std::to_string(wave_size) +
                              ", policy " + policy);
      }
}

/// White furnace: walls of radiance 1 around volumes without absorption give 1 everywhere, also
/// where volumes overlap.
TEST(Volumes, FurnaceGainsAndLosesNothing) {
  for (const float anisotropy : {0.f, 0.7f, -0.5f}) {
    SceneBuilder b;
    Material wall = make_material(ProgramId::kEmissive);
    wall.emission = {1, 1, 1};
    b.add_to_group(0, b.add_mesh(make_mesh(box({-2, -2, -2}, {2, 2, 2}), b.add_material(wall))));
    Volume fog = make_box({-1.5f, -1.5f, -1.5f}, {1.5f, 1.5f, 1.5f}, {0.3f, 0.6f, 1});
    fog.albedo = {1, 1, 1};
    fog.anisotropy = anisotropy;
    b.add_volume(fog);
    Volume ball;
    ball.density =
        between(make_grid(17,
                          [](int x, int y, int z) {
                            const int r = (x - 8) * (x - 8) + (y - 8) * (y - 8) + (z - 8) * (z - 8);
                            return r < 64 ? 2.f : 0.f;
                          }),
                17, -1, 1);
    ball.albedo = {1, 1, 1};
    ball.anisotropy = -anisotropy;
    b.add_volume(ball);
    b.set_camera(make_camera({0, 0, 1.2}, {0, 0, 0}));
    Settings s = volume_settings(16, 16, size_for_build(256, 16), 200);
    s.roulette = RouletteKind::kOff;
    WaveRun run(b.build(), {s, lane_widths().back(), 1});
    run.all(4096);
    for (size_t c = 0; c < 3; ++c) {
      const Mean m = mean_of(run.image(), c);
      EXPECT_NEAR(m.mean, 1, 4.2 * m.error + 1e-4) << anisotropy;
      EXPECT_LT(4.2 * m.error, kSanitized ? 0.5 : 0.03) << "too noisy to tell";
    }
  }
}

TEST(Volumes, FillTheSceneAndHaveMaterialsOfTheirOwn) {
  const auto scene = smoky(false);
  EXPECT_EQ(scene->volumes().size(), 2u);
  EXPECT_EQ(scene->materials().size(), 5u);
  EXPECT_EQ(scene->view().volumes.first_material, 3u);
  EXPECT_EQ(scene->materials()[3].program, ProgramId::kVolume);
  EXPECT_GT(scene->bytes().volumes, 1000u);
  SceneBuilder alone;
  alone.add_volume(make_box({-1, -2, -3}, {1, 2, 3}, {1, 1, 1}));
  const auto box = alone.build();
  EXPECT_EQ(box->bounds().hi.z, 3.f);
  Material m = make_material(ProgramId::kVolume);
  EXPECT_THROW(SceneBuilder().add_material(m), Error);
}

}  // namespace
}  // namespace wavecomb
