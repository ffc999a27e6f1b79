// SPDX-License-Identifier: Apache-2.0
/// Tests of render plans and of the pilot renders that run before the first pass.
#include <gtest/gtest.h>

#include "scene_testing.h"
#include "wavecomb/render/pilots/pilots.h"
#include "wavecomb/render/render_plan.h"

namespace wavecomb {
namespace {

using namespace scene_testing;

Settings small() {
  Settings s;
  s.width = 32;
  s.height = 24;
  s.spp = 64;
  s.threads = 2;
  return s;
}

TEST(RenderPlan, GivesEveryThreadSeveralWaves) {
  Settings s = small();
  EXPECT_EQ(wave_size_for(s, 1'000'000), 4096u);
  s.spp = 1;
  EXPECT_EQ(wave_size_for(s, 32 * 24), 32u * 24u / 8u);
  EXPECT_EQ(wave_size_for(s, 10), 64u) << "the least";
  s.wave_size = 77;
  EXPECT_EQ(wave_size_for(s, 1'000'000), 77u);
}

TEST(RenderPlan, FillsAWaveInAPassOfASmallImage) {
  Settings s = small();
  EXPECT_EQ(samples_of_pass(s, 1'000'000, 4096), 16u);
  EXPECT_EQ(samples_of_pass(s, 100, 4096), 41u);
  s.spp = 20;
  EXPECT_EQ(samples_of_pass(s, 100, 4096), 20u) << "no more than there are";
}

TEST(RenderPlan, HasWhatTheSettingsAskFor) {
  const ScenePtr scene = cornell();
  const EmbreeAccelerator accelerator(scene, 1);
  Settings s = small();
  s.policy = "adaptive";
  s.region = Region{4, 3, 20, 13};
  s.crop = true;
  const RenderPlan plan(*scene, accelerator, s, {}, nullptr);
  EXPECT_GT(plan.policies.size(), 1u);
  EXPECT_EQ(plan.policies.front()->name(), "none");
  EXPECT_EQ(plan.waves.threads, 2u);
  EXPECT_EQ(plan.traits.size(), scene->materials().size());
  const Film film = plan.make_film();
  EXPECT_EQ(film.pixel_count(), 16u * 10u);
  EXPECT_FALSE(film.has_error());
  EXPECT_FALSE(film.has_cascades());
  s.error = true;
  s.firefly = Firefly::kReweight;
  const RenderPlan other(*scene, accelerator, s, {}, plan.policies.back());
  EXPECT_EQ(other.policies, std::vector{plan.policies.back()});
  EXPECT_TRUE(other.make_film().has_error());
  EXPECT_TRUE(other.make_film().has_cascades());
}

TEST(Pilots, FindWhatARenderNeedsAndKeepIt) {
  const ScenePtr scene = mixed();
  const EmbreeAccelerator accelerator(scene, 1);
  Settings s = small();
  s.guiding = Guiding::kOn;
  s.spp = 256;
  PilotCache cache;
  const auto pilots_of = [&](const Settings& settings) {
    const RenderPlan plan(*scene, accelerator, settings, {}, nullptr);
    RenderCosts costs(*scene, plan.traits, settings);
    Film film = plan.make_film();
    const JointPasses passes(plan.joint, settings);
    const WaveContext context = plan.make_context(film, costs, nullptr, passes);
    const auto no = [] { return false; };
    PilotResults found = run_pilots({.scene = scene,
                                     .plan = plan,
                                     .context = context,
                                     .costs = costs,
                                     .light_settings = settings,
                                     .camera = {},
                                     .learned = {},
                                     .joint = nullptr,
                                     .stopped = no,
                                     .halted = no},
                                    cache);
    EXPECT_EQ(context.guide, nullptr) << "pilots change nothing of the render";
    WaveContext used = context;
    found.apply(used);
    EXPECT_EQ(used.guide != nullptr, found.training->field != nullptr);
    return found;
  };
  const PilotResults first = pilots_of(s);
  ASSERT_TRUE(first.lights && first.training);
  EXPECT_FALSE(first.joint) << "no paths start at lights";
  EXPECT_GT(first.training->statistics.paths, 0u);
  EXPECT_FALSE(first.training->statistics.is_reused);
  EXPECT_EQ(first.lights->tables.shares.size(), first.lights->parts.size());
  s.seed = 5;
  const PilotResults again = pilots_of(s);
  EXPECT_TRUE(again.training->statistics.is_reused) << "the seed changes nothing that is learned";
  EXPECT_EQ(again.training->field, first.training->field);
  EXPECT_EQ(again.lights->tables.shares, first.lights->tables.shares);
  s.guiding = Guiding::kOff;
  s.roulette = RouletteKind::kThroughput;
  EXPECT_EQ(pilots_of(s).training->statistics.paths, 0u);
  s.transport = Transport::kLight;
  const PilotResults aimed = pilots_of(s);
  ASSERT_TRUE(aimed.joint);
}

}  // namespace
}  // namespace wavecomb
