// SPDX-License-Identifier: Apache-2.0
// Recording the rays of a render and tracing them again.
#include "scene_testing.h"
#include "wavecomb/render/inspection/ray_recording.h"

namespace wavecomb {
namespace {

using namespace scene_testing;

constexpr uint64_t kPlenty = 1u << 30;
constexpr std::array<bool, kRayKinds> kAll{true, true, true};

Settings recorded_settings() {
  Settings s;
  s.width = size_for_build(48, 3);
  s.height = size_for_build(40, 3);
  s.spp = 4;
  s.threads = 2;
  return s;
}

TEST(RayRecording, KeepsEveryRayAndChangesNothing) {
  const ScenePtr scene = mixed(1.f);
  WavefrontRenderer renderer(scene, 2);
  const Settings settings = recorded_settings();
  const RenderedImage plain = renderer.render(settings);
  RayRecording recording(scene, kPlenty);
  const RenderedImage recorded = renderer.render(settings, {.recorder = &recording});
  expect_same_image(plain, recorded, "with a recorder");

  const RenderStatistics& s = renderer.statistics();
  ASSERT_GT(s.rays_at.size(), 3u);
  EXPECT_EQ(recording.rays_at(), s.rays_at);
  EXPECT_EQ(recording.shadow_rays_at(), s.shadow_rays_at);
  EXPECT_EQ(recording.rays_at()[0], uint64_t{settings.width} * settings.height * settings.spp);
  EXPECT_GE(recording.bytes(), 24 * s.rays + 28 * s.shadow_rays);
}

TEST(RayRecording, EmbreeAloneHitsWhatARenderHits) {
  // A scene with instances and every kind of light, including round ones.
  const ScenePtr scene = mixed(1.f);
  WavefrontRenderer renderer(scene, 2);
  RayRecording recording(scene, kPlenty);
  renderer.render(recorded_settings(), {.recorder = &recording});
  const RenderStatistics& s = renderer.statistics();

  const ReplayTimes expected = recording.replay({false, 1, {1, 1, 1}, {}, kAll});
  EXPECT_EQ(expected.rays[0] + expected.rays[1], s.rays);
  EXPECT_EQ(expected.rays[2], s.shadow_rays);
  for (size_t k = 0; k < kRayKinds; ++k) {
    EXPECT_GT(expected.hits[k], 0u);
    EXPECT_LT(expected.hits[k], expected.rays[k]);
  }
  const uint32_t native = EmbreeAccelerator(scene, 1).native_width();
  for (const bool alone : {true, false})
    for (const bool coherent : {true, false})
      for (const uint32_t w : {1u, 4u, 8u, 16u}) {
        if (w > native) continue;
        const ReplayTimes got =
            recording.replay({alone, 2, {w, w, w}, {coherent, coherent, coherent}, kAll});
        EXPECT_EQ(got.rays, expected.rays);
        EXPECT_EQ(got.hits, expected.hits)
            << w << (alone ? ", Embree alone" : ", as a render") << (coherent ? ", coherent" : "");
        for (size_t k = 0; k < kRayKinds; ++k) EXPECT_GT(got.thread_s[k], 0);
        EXPECT_GT(got.wall_s, 0);
      }
  const ReplayTimes some = recording.replay({true, 2, {4, 4, 4}, {}, {false, true, false}});
  EXPECT_EQ(some.rays, (std::array<uint64_t, kRayKinds>{0, expected.rays[1], 0}));
}

TEST(RayRecording, StopsAtItsLimit) {
  const ScenePtr scene = cornell();
  WavefrontRenderer renderer(scene, 2);
  RayRecording recording(scene, 4096);
  try {
    renderer.render(recorded_settings(), {.recorder = &recording});
    FAIL() << "recorded " << recording.bytes() << " bytes";
  } catch (const Error& error) {
    EXPECT_NE(std::string(error.what()).find("fewer samples"), std::string::npos) << error.what();
  }
}

TEST(RayRecording, RefusesWhatEmbreeAloneCannotSee) {
  EXPECT_THROW(RayRecording(presence(), kPlenty), Error);
  RayRecording recording(cornell(), kPlenty);
  EXPECT_THROW(recording.replay({true, 1, {16, 3, 16}, {}, kAll}), Error);
}

}  // namespace
}  // namespace wavecomb
