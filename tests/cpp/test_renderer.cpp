// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/render/lane_kernels.h"
#include "wavecomb/render/renderer.h"
#include "wavecomb/render/snapshot.h"
#include "wavecomb/render/statistics/render_statistics.h"
#include "wavecomb/scene/scene.h"

#include <chrono>

#include "scene_testing.h"

namespace wavecomb {
namespace {

using namespace scene_testing;
using Clock = std::chrono::steady_clock;

Settings tiny() {
  Settings s;
  s.width = 24;
  s.height = 16;
  s.spp = 4;
  return s;
}

TEST(Renderer, RefusesWhatCannotBe) {
  WavefrontRenderer renderer(cornell());
  const auto complaint = [&](const Settings& s) -> std::string {
    try {
      renderer.render(s);
    } catch (const Error& e) {
      return e.what();
    }
    return "";
  };
  Settings s = tiny();
  s.spp = 0;
  EXPECT_NE(complaint(s).find("spp"), std::string::npos);
  s = tiny();
  s.policy = "alphabetical";
  EXPECT_NE(complaint(s).find("policy"), std::string::npos);
  EXPECT_NE(complaint(s).find("alphabetical"), std::string::npos);
  EXPECT_NE(complaint(s).find("program"), std::string::npos) << "names what there is";
  s = tiny();
  s.lanes = 3;
  EXPECT_NE(complaint(s).find("lanes"), std::string::npos);
  // Rendering still works.
  EXPECT_EQ(complaint(tiny()), "");
}

TEST(Renderer, RendersAgainAndAgain) {
  WavefrontRenderer renderer(mixed());
  Settings s = tiny();
  const Picture first = renderer.render(s);
  s.width = 7;
  renderer.render(s);
  s.spp = 1;
  s.wave_size = 64;
  renderer.render(s);
  expect_same_picture(first, renderer.render(tiny()), "third time");
  s = tiny();
  s.seed = 1;
  EXPECT_NE(first.beauty, renderer.render(s).beauty);
}

TEST(Renderer, MoreSamplesContainFewer) {
  // Sample i of a pixel does not depend on spp: the means of 8 and 16 samples are related.
  WavefrontRenderer renderer(cornell());
  Settings s = tiny();
  s.spp = 16;
  const Picture a = renderer.render(s);
  s.wave_size = 64;
  s.threads = 2;
  expect_same_picture(a, renderer.render(s), "other passes");
  EXPECT_EQ(a.samples, std::vector<uint32_t>(24 * 16, 16));
}

TEST(Renderer, StatisticsAddUp) {
  WavefrontRenderer renderer(mixed());
  for (const IntegratorKind kind : {IntegratorKind::kWavefront, IntegratorKind::kReference}) {
    Settings s = tiny();
    s.integrator = kind;
    s.threads = 2;
    renderer.render(s);
    const RenderStatistics& r = renderer.statistics();
    EXPECT_EQ(r.samples, 24u * 16 * 4);
    EXPECT_GE(r.rays, r.samples);
    EXPECT_GE(r.rays, r.records);
    EXPECT_GT(r.shadow_rays, 0u);
    EXPECT_LE(r.shadow_rays, r.records);
    EXPECT_EQ(r.threads, 2u);
    EXPECT_GT(r.accelerator_bytes, 0u);
    EXPECT_GT(r.peak_rss_bytes, 1u << 20);
    EXPECT_FALSE(r.cancelled);
    EXPECT_GT(r.build_s, 0);
    EXPECT_GT(r.render_s, 0);
    double phases = 0;
    for (const auto& [name, seconds] : r.phases_s) {
      EXPECT_GE(seconds, 0) << name;
      phases += seconds;
    }
    EXPECT_GT(phases, 0);
    EXPECT_LE(phases, 2 * r.render_s * 1.01 + 1e-4);
    if (kind == IntegratorKind::kWavefront) {
      EXPECT_GT(r.wave_bytes, 0u);
      EXPECT_GE(r.packet_lanes, r.records);
      EXPECT_EQ(r.lanes, lane_widths().back());
    }
  }
}

TEST(Renderer, ProgressEndsAtTheTotal) {
  WavefrontRenderer renderer(cornell());
  Settings s = tiny();
  uint64_t last = 0, calls = 0;
  renderer.render(s, {.progress = [&](const RenderStatus& status) {
                    EXPECT_EQ(status.samples_total, 24u * 16 * 4);
                    EXPECT_LE(status.samples_done, status.samples_total);
                    EXPECT_GE(status.samples_done, last);
                    last = status.samples_done;
                    ++calls;
                    return Request::kGoOn;
                  }});
  EXPECT_EQ(last, 24u * 16 * 4);
  EXPECT_GE(calls, 1u);
}

TEST(Renderer, CancelKeepsWhatIsDone) {
  WavefrontRenderer renderer(cornell());
  for (const IntegratorKind kind : {IntegratorKind::kWavefront, IntegratorKind::kReference}) {
    Settings s;
    s.width = s.height = 512;
    s.spp = 1u << 16;  // would take hours
    s.integrator = kind;
    s.threads = 2;
    const auto start = Clock::now();
    auto asked = start;
    const Picture p =
        renderer.render(s, {.progress = [&](const RenderStatus& status) {
                          asked = Clock::now();
                          return status.samples_done > 0 ? Request::kStop : Request::kGoOn;
                        }});
    const double took = std::chrono::duration<double>(Clock::now() - asked).count();
    EXPECT_LT(took, kSanitized ? 20 : 2) << "seconds after the callback said stop";
    EXPECT_TRUE(renderer.statistics().cancelled);
    ASSERT_EQ(p.samples.size(), 512u * 512);
    ASSERT_EQ(p.beauty.size(), 3u * 512 * 512);
    uint64_t samples = 0;
    for (size_t i = 0; i < p.samples.size(); ++i) {
      samples += p.samples[i];
      ASSERT_TRUE(std::isfinite(p.beauty[3 * i]));
      if (p.samples[i] == 0) {
        ASSERT_EQ(p.beauty[3 * i], 0);
      }
    }
    EXPECT_GT(samples, 0u);
    EXPECT_EQ(samples, renderer.statistics().samples);
  }
}

TEST(Renderer, ExceptionsOfTheCallbackArriveAtTheCaller) {
  WavefrontRenderer renderer(cornell());
  Settings s;
  s.width = s.height = 512;
  s.spp = 1u << 16;
  EXPECT_THROW(
      renderer.render(s, {.progress = [](const RenderStatus&) -> Request { throw Error("stop"); }}),
      Error);
  renderer.render(tiny());
  EXPECT_FALSE(renderer.statistics().cancelled);
}

TEST(Renderer, LaneWidths) {
  const std::vector<uint32_t> widths = lane_widths();
  EXPECT_TRUE(std::is_sorted(widths.begin(), widths.end()));
  EXPECT_EQ(widths.front(), 1u);
  WavefrontRenderer renderer(cornell());
  for (const uint32_t lanes : widths) {
    Settings s = tiny();
    s.lanes = lanes;
    renderer.render(s);
    EXPECT_EQ(renderer.statistics().lanes, lanes);
  }
}

TEST(Renderer, KeepsTheSceneAlive) {
  std::unique_ptr<WavefrontRenderer> renderer;
  {
    const ScenePtr scene = cornell();
    renderer = std::make_unique<WavefrontRenderer>(scene);
  }
  EXPECT_GT(mean_of(renderer->render(tiny())).mean, 0.01);
}

}  // namespace
}  // namespace wavecomb
