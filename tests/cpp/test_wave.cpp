// SPDX-License-Identifier: Apache-2.0
// Reproducibility: all schedules give bitwise the same image.
#include <bit>
#include <numeric>

#include "curve_testing.h"
#include "wave_testing.h"
#include "wavecomb/wave/kernels/kernel_matrix.h"

namespace wavecomb {
namespace {

using namespace scene_testing;
using namespace wave_testing;

RenderedImage reference(const ScenePtr& scene, const Settings& settings,
                        const std::shared_ptr<const EmbreeAccelerator>& accel) {
  WaveRun run(scene, {settings, kReferenceLanes, 1}, accel);
  run.all(64);
  return run.image();
}

/// Expects all schedules to give the image of the reference integrator.
void expect_one_image(const ScenePtr& scene, Settings settings) {
  const auto accel = std::make_shared<const EmbreeAccelerator>(scene, 2u);
  const RenderedImage expected = reference(scene, settings, accel);
  double light = 0;
  for (const float x : expected.beauty) {
    ASSERT_TRUE(std::isfinite(x));
    light += x;
  }
  EXPECT_GT(light, 0) << "a black picture shows nothing";
  for (const uint32_t lanes : lane_widths())
    for (const uint32_t wave_size : {64u, 256u, 4096u, 65536u})
      for (const char* policy : {"none", "program"})
        for (const Materialize materialize : {Materialize::kOff, Materialize::kOn}) {
          if (policy[0] == 'n' && materialize == Materialize::kOn) continue;  // nothing to move
          settings.policy = policy;
          settings.materialize = materialize;
          const uint32_t traversal = lanes == 1 ? 1 : std::min(lanes, accel->native_width());
          WaveRun run(scene, {settings, lanes, traversal}, accel);
          run.all(wave_size, wave_size == 256 ? 3 : 16);
          expect_same_image(expected, run.image(),
                            std::to_string(lanes) + " lanes, waves of " +
                                std::to_string(wave_size) + ", policy " + policy +
                                (materialize == Materialize::kOn ? ", materialized" : ""));
          if (testing::Test::HasFailure()) return;
        }
}

Settings wave_settings() {
  Settings s;
  s.width = size_for_build(37, 3);
  s.height = size_for_build(29, 3);
  s.spp = 5;
  s.max_depth = 6;
  return s;
}

TEST(Wave, DiffuseBoxIsOnePicture) {
  expect_one_image(cornell(), wave_settings());
}
TEST(Wave, AllProgramsAreOnePicture) {
  expect_one_image(mixed(), wave_settings());
}
TEST(Wave, EmissiveMeshesAreOnePicture) {
  expect_one_image(emissive_meshes(), wave_settings());
}
TEST(Wave, LightsByTreeAreOnePicture) {
  Settings s = wave_settings();
  s.light_selection = LightSelection::kTree;
  s.width = s.height = 19;
  for (const ScenePtr& scene : {cornell(), mixed(), emissive_meshes()}) expect_one_image(scene, s);
}
/// A scene with a ball, a strand and a floor under 40 point lights.
ScenePtr under_point_lights() {
  SceneBuilder b;
  const uint32_t grey = b.add_material(make_material(ProgramId::kDiffuse, {0.6f, 0.6f, 0.6f}));
  const uint32_t gold = b.add_material(make_material(ProgramId::kMetal, {0.9f, 0.7f, 0.3f}, 0.4f));
  b.add_to_group(0, b.add_mesh(make_mesh(curve_testing::ground(4, -1.2f), grey)));
  b.add_to_group(0, b.add_mesh(make_mesh(sphere(8, true), gold)));
  for (const Primitive primitive : curve_testing::curved_primitives())
    b.add_to_group(0, b.add_mesh(curve_testing::make_curves(
                          curve_testing::strands(primitive, 12, 4, 1.f, 0.05f, 3), grey)));
  for (int i = 0; i < 40; ++i) {
    const double x = -2 + 0.5 * (i % 8), z = -1 + 0.5 * (i / 8);
    Light light = make_light(LightKind::kSphere, {1, 0.9f, 0.7f}, translate(x, 2, z));
    light.radius = 0;
    b.add_light(light);
  }
  b.set_camera(make_camera({0, 0.5, 5}, {0, 0, 0}, 0.9f));
  return b.build();
}

// A light sample includes its selection probability, so MIS need not descend the light tree again.
// Bounces do not hit point lights, so wrong trails must not change the image.
TEST(Wave, LightSamplesDescendTheTreeOnce) {
  Settings s = wave_settings();
  s.light_selection = LightSelection::kTree;
  const ScenePtr scene = under_point_lights();
  const std::vector<uint32_t> none(scene->view().lights.count, kNoLight);
  for (const uint32_t lanes : lane_widths()) {
    WaveRun expected(scene, {s, lanes, 1}), without_trails(scene, {s, lanes, 1});
    ASSERT_TRUE(expected.context().scene.lights.by_tree);
    without_trails.replace_trails(none);
    expected.all(4096);
    without_trails.all(4096);
    const std::vector<float> beauty = expected.image().beauty;
    EXPECT_GT(std::accumulate(beauty.begin(), beauty.end(), 0.0), 0);
    expect_same_image(expected.image(), without_trails.image(), std::to_string(lanes) + " lanes");
  }
}

// Verifies that the previous test can fail: with lights that bounces hit, trails affect the image.
TEST(Wave, LightsThatBouncesHitNeedTrails) {
  Settings s = wave_settings();
  s.light_selection = LightSelection::kTree;
  const ScenePtr scene = mixed();
  const std::vector<uint32_t> none(scene->view().lights.count, kNoLight);
  WaveRun expected(scene, {s, lane_widths().back(), 1}), wrong(scene, {s, lane_widths().back(), 1});
  wrong.replace_trails(none);
  expected.all(4096);
  wrong.all(4096);
  EXPECT_NE(expected.image().beauty, wrong.image().beauty);
}

TEST(Wave, PresenceIsOnePicture) {
  expect_one_image(presence(), wave_settings());
}

TEST(Wave, CurvesAndPointsAreOnePicture) {
  expect_one_image(curve_testing::hairy(), wave_settings());
}

TEST(Wave, EverySettingIsOnePicture) {
  Settings s = wave_settings();
  s.width = s.height = 13;
  s.cosine_sampling = true;
  expect_one_image(mixed(), s);
  s = wave_settings();
  s.width = s.height = 13;
  s.sampler = SamplerKind::kIndependent;
  s.roulette = RouletteKind::kOff;
  s.filter = FilterKind::kBox;
  s.filter_width = 1;
  s.schlick_fresnel = true;
  s.clamp_indirect = 0.3f;
  s.seed = 99;
  expect_one_image(mixed(), s);
}

TEST(Wave, EveryPolicyIsOnePicture) {
  for (const ScenePtr& scene : {mixed(), presence()}) {
    const auto accel = std::make_shared<const EmbreeAccelerator>(scene, 2u);
    Settings s = wave_settings();
    const RenderedImage expected = reference(scene, s, accel);
    for (const std::string& policy : policy_names())
      for (const uint32_t wave_size : {64u, 1500u})
        for (const Materialize materialize : {Materialize::kOff, Materialize::kOn}) {
          s.policy = policy;
          s.materialize = materialize;
          WaveRun run(scene, {s, lane_widths().back(), accel->native_width()}, accel);
          run.all(wave_size);
          expect_same_image(expected, run.image(), "policy " + policy);
        }
  }
}

TEST(Wave, RayOrdersDoNotShow) {
  for (const ScenePtr& scene : {mixed(), presence()}) {
    const auto accel = std::make_shared<const EmbreeAccelerator>(scene, 2u);
    Settings s = wave_settings();
    const RenderedImage expected = reference(scene, s, accel);
    for (const uint32_t lanes : lane_widths())
      for (const RayOrder bounce : {RayOrder::kSlot, RayOrder::kMorton, RayOrder::kMortonOctant,
                                    RayOrder::kDirection, RayOrder::kAuto})
        for (const RayOrder shadow :
             {RayOrder::kSlot, RayOrder::kMorton, RayOrder::kDirection, RayOrder::kAuto}) {
          s.ray_order = bounce;
          s.shadow_order = shadow;
          WaveRun run(scene, {s, lanes, lanes == 1 ? 1 : accel->native_width()}, accel);
          run.all(700);
          expect_same_image(expected, run.image(),
                            "ray orders " + std::to_string(static_cast<int>(bounce)) + ", " +
                                std::to_string(static_cast<int>(shadow)));
        }
  }
}

TEST(Wave, PacketsOfRaysDoNotShow) {
  const ScenePtr scene = mixed();
  const auto accel = std::make_shared<const EmbreeAccelerator>(scene, 2u);
  const Settings s = wave_settings();
  const RenderedImage expected = reference(scene, s, accel);
  for (const uint32_t traversal : {1u, 4u, 8u, 16u}) {
    WaveRun run(scene, {s, lane_widths().back(), traversal}, accel);
    run.all(1000);
    expect_same_image(expected, run.image(), "packets of " + std::to_string(traversal));
  }
}

TEST(Wave, LargeWaves) {
  // Uses more than 65,536 paths, so that the largest wave is full.
  if (kSanitized) GTEST_SKIP() << "too slow under sanitizers";
  const ScenePtr scene = cornell();
  const auto accel = std::make_shared<const EmbreeAccelerator>(scene, 2u);
  Settings s;
  s.width = 70;
  s.height = 65;
  s.spp = 16;
  s.max_depth = 3;
  const RenderedImage expected = reference(scene, s, accel);
  for (const char* policy : {"none", "program"}) {
    s.policy = policy;
    WaveRun run(scene, {s, lane_widths().back(), accel->native_width()}, accel);
    run.all(65536);
    expect_same_image(expected, run.image(), std::string("65536 paths, policy ") + policy);
  }
}

TEST(Wave, ThreadsDoNotShow) {
  for (const ScenePtr& scene : {cornell(), mixed(), emissive_meshes(), presence()}) {
    const auto accel = std::make_shared<const EmbreeAccelerator>(scene, 2u);
    Settings s = wave_settings();
    WavefrontRenderer renderer(scene);
    for (const LightWeights weights : {LightWeights::kPower, LightWeights::kCalibrated}) {
      s.light_weights = weights;
      s.threads = 1;
      s.integrator = IntegratorKind::kReference;
      // Without a renderer there is no calibration, so lights are selected in proportion to power.
      const RenderedImage expected =
          weights == LightWeights::kPower ? reference(scene, s, accel) : renderer.render(s);
      for (const uint32_t threads : {1u, 2u, 3u}) {
        s.threads = threads;
        s.integrator = IntegratorKind::kWavefront;
        for (const uint32_t wave_size : {0u, 64u, 4096u}) {
          s.wave_size = wave_size;
          expect_same_image(expected, renderer.render(s), std::to_string(threads) + " threads");
        }
        s.integrator = IntegratorKind::kReference;
        expect_same_image(expected, renderer.render(s), "reference, threads");
      }
    }
  }
}

TEST(Wave, EdgeCases) {
  const ScenePtr scene = mixed();
  SceneBuilder empty_builder, unlit_builder, missed_builder;
  const ScenePtr empty = empty_builder.build();
  unlit_builder.add_to_group(0, unlit_builder.add_mesh(make_mesh(sphere(6, true))));
  unlit_builder.set_camera(make_camera({0, 0, 4}, {0, 0, 0}));
  const ScenePtr unlit = unlit_builder.build();
  missed_builder.add_to_group(0, missed_builder.add_mesh(make_mesh(sphere(6, true))));
  missed_builder.add_light(make_light(LightKind::kDome, {1, 2, 3}));
  missed_builder.set_camera(make_camera({0, 0, 4}, {0, 0, 9}));
  const ScenePtr missed = missed_builder.build();
  struct Case {
    ScenePtr scene;
    uint32_t width, height, spp, max_depth;
  };
  const std::vector<Case> cases = {
      {scene, 1, 1, 1, 8},   {scene, 1, 1, 17, 8}, {scene, 1, 1, 130, 8}, {scene, 17, 3, 1, 8},
      {scene, 5, 33, 17, 2}, {scene, 9, 9, 4, 0},  {scene, 9, 9, 4, 1},   {empty, 9, 7, 3, 8},
      {unlit, 9, 7, 3, 8},   {missed, 9, 7, 3, 8}, {scene, 65, 2, 2, 3}};
  for (const Case& c : cases) {
    SCOPED_TRACE(testing::Message()
                 << c.width << " x " << c.height << ", " << c.spp << " spp, depth " << c.max_depth);
    const auto accel = std::make_shared<const EmbreeAccelerator>(c.scene, 1u);
    Settings s;
    s.width = c.width;
    s.height = c.height;
    s.spp = c.spp;
    s.max_depth = c.max_depth;
    const RenderedImage expected = reference(c.scene, s, accel);
    for (const uint32_t lanes : lane_widths())
      for (const uint32_t wave_size : {64u, 1000u}) {
        WaveRun run(c.scene, {s, lanes, lanes == 1 ? 1 : accel->native_width()}, accel);
        run.all(wave_size);
        expect_same_image(expected, run.image(), std::to_string(lanes) + " lanes");
      }
    EXPECT_EQ(expected.samples, std::vector<uint32_t>(size_t{c.width} * c.height, c.spp));
    for (size_t i = 0; i < expected.beauty.size(); ++i) {
      if (c.scene == empty || c.scene == unlit) {
        EXPECT_EQ(expected.beauty[i], 0);
      }
      if (c.scene == missed) {
        EXPECT_EQ(expected.beauty[i], static_cast<float>(1 + i % 3));
      }
    }
    for (const float depth : expected.depth)
      if (c.scene == empty || c.scene == missed) {
        EXPECT_EQ(depth, kInf);
      }
  }
}

TEST(Wave, DepthZeroSeesEmittersOnly) {
  Settings s = wave_settings();
  s.max_depth = 0;
  const RenderedImage image = WavefrontRenderer(cornell()).render(s);
  size_t lit = 0;
  for (size_t i = 0; i < image.depth.size(); ++i) {
    // The light's red is 12; some of a pixel's five samples see it.
    const double seen = image.beauty[3 * i] / 12.0 * s.spp;
    EXPECT_NEAR(seen, std::round(seen), 1e-4);
    lit += seen > 0;
  }
  EXPECT_GT(lit, 0u);
  EXPECT_LT(lit, image.depth.size() / 4);
  const RenderedImage distance_lights = WavefrontRenderer(emissive_meshes()).render(s);
  EXPECT_GT(*std::max_element(distance_lights.beauty.begin(), distance_lights.beauty.end()), 1);
}

Settings with_all_aovs() {
  Settings s = wave_settings();
  s.aovs.bits = AovSet::kAll | Aov::kExpressions;
  s.expressions = {{"diffuse", "C<RD>.*"}, {"specular", "C<.[GS]>+[LO]"}, {"lamps", "C.*O"}};
  return s;
}

TEST(Wave, AllAovsAreOnePicture) {
  Settings s = with_all_aovs();
  expect_one_image(mixed(), s);
  expect_one_image(emissive_meshes(), s);
  s.clamp_indirect = 0.05f;
  s.roulette = RouletteKind::kCostAware;
  s.roulette_depth = 0;
  expect_one_image(mixed(), s);
}

TEST(Wave, PartsAndLightGroupsAddUp) {
  for (const ScenePtr& scene : {mixed(), emissive_meshes(), cornell()})
    for (const float clamp : {0.f, 0.05f}) {
      Settings s = with_all_aovs();
      s.clamp_indirect = clamp;
      const RenderedImage p = WavefrontRenderer(scene).render(s);
      std::vector<double> groups(p.beauty.size());
      std::vector<double> lit(scene->light_groups().size());
      for (size_t g = 0; g < lit.size(); ++g) {
        const AovLayer& one = layer(p, "light_" + scene->light_groups()[g]);
        for (size_t i = 0; i < groups.size(); ++i) {
          groups[i] += one.values[i];
          lit[g] += one.values[i];
        }
      }
      const std::vector<float>&e = layer(p, "emission").values, &d = layer(p, "direct").values,
            &r = layer(p, "indirect").values;
      double parts[3] = {0, 0, 0};
      for (size_t i = 0; i < groups.size(); ++i) {
        const double tolerance = 2e-6 * (1.0 + p.beauty[i]);
        ASSERT_NEAR(groups[i], p.beauty[i], tolerance) << i;
        ASSERT_NEAR(double{e[i]} + d[i] + r[i], p.beauty[i], tolerance) << i;
        parts[0] += e[i];
        parts[1] += d[i];
        parts[2] += r[i];
      }
      for (const double part : parts) EXPECT_GT(part, 0);
      // All light groups but the first contain lights of this scene.
      for (size_t g = 1; g < lit.size(); ++g) {
        EXPECT_GT(lit[g], 0) << scene->light_groups()[g];
      }
    }
}

TEST(Wave, OneLightGroupByName) {
  Settings s = wave_settings();
  s.aovs.bits = static_cast<uint32_t>(Aov::kLightGroups);
  const RenderedImage all = WavefrontRenderer(mixed()).render(s);
  EXPECT_TRUE(all.albedo.empty());
  s.light_groups = {"sun"};
  const RenderedImage one = WavefrontRenderer(mixed()).render(s);
  ASSERT_EQ(one.aovs.size(), 1u);
  expect_same_bits(one.aovs[0].values, layer(all, "light_sun").values, "sun");
  s.light_groups = {"moon"};
  try {
    WavefrontRenderer(mixed()).render(s);
    FAIL() << "there is no moon";
  } catch (const Error& error) {
    EXPECT_STREQ(error.what(), "the scene has no light group 'moon'; it has other, bulb, sun");
  }
}

TEST(Wave, IdsAndPlacesOfASimpleScene) {
  SceneBuilder b;
  const uint32_t red = b.add_material(make_material(ProgramId::kDiffuse, {0.8f, 0.2f, 0.1f}));
  MeshData wall = quad({-9, -9, -3}, {18, 0, 0}, {0, 18, 0});
  wall.uvs = {0, 0, 2, 0, 2, 2, 0, 2};
  wall.uvs_at = Attribute::kVertex;
  b.add_to_group(0, b.add_mesh(make_mesh(wall, red)));
  b.set_camera(make_camera({0, 0, 2}, {0, 0, 0}));
  const Settings s = with_all_aovs();
  const ScenePtr scene = b.build();
  const RenderedImage p = WavefrontRenderer(scene).render(s);
  const std::vector<float>&position = layer(p, "position").values, &uv = layer(p, "uv").values;
  const std::vector<float>& pairs = layer(p, "crypto_material").values;
  for (size_t i = 0; i < p.depth.size(); ++i) {
    EXPECT_NEAR(position[3 * i + 2], -3, 1e-5);
    EXPECT_NEAR(uv[2 * i], (position[3 * i] + 9) / 9, 1e-5);
    EXPECT_NEAR(uv[2 * i + 1], (position[3 * i + 1] + 9) / 9, 1e-5);
    EXPECT_EQ(layer(p, "material_id").values[i], 1);
    EXPECT_EQ(layer(p, "instance_id").values[i], 1);
    EXPECT_EQ(std::bit_cast<uint32_t>(pairs[12 * i]), crypto_id(scene->materials()[0].name));
    EXPECT_EQ(pairs[12 * i + 1], 1);
    EXPECT_EQ(pairs[12 * i + 3], 0);
    EXPECT_GT(layer(p, "cost").values[i], 0);
  }
  // The nearest of five samples is within a pixel of the point at the pixel centre.
  const size_t middle = s.width / 2 + size_t{s.height / 2} * s.width;
  const float pixel = position[3 * (middle + 1)] - position[3 * middle];
  EXPECT_LT(std::abs(position[3 * middle]), 1.5f * std::abs(pixel));
}

TEST(Wave, AovsOfASimpleScene) {
  SceneBuilder b;
  const uint32_t red = b.add_material(make_material(ProgramId::kDiffuse, {0.8f, 0.2f, 0.1f}));
  b.add_to_group(0, b.add_mesh(make_mesh(quad({-9, -9, -3}, {18, 0, 0}, {0, 18, 0}), red)));
  b.set_camera(make_camera({0, 0, 2}, {0, 0, 0}));
  const RenderedImage p = WavefrontRenderer(b.build()).render(wave_settings());
  for (size_t i = 0; i < p.depth.size(); ++i) {
    EXPECT_NEAR(p.depth[i], 5, 1e-5);
    EXPECT_FLOAT_EQ(p.albedo[3 * i], 0.8f);
    EXPECT_FLOAT_EQ(p.albedo[3 * i + 1], 0.2f);
    EXPECT_NEAR(p.normal[3 * i], 0, 1e-6);
    EXPECT_NEAR(p.normal[3 * i + 2], 1, 1e-6);
  }
}

TEST(Wave, CountsAgreeWithTheReference) {
  const ScenePtr scene = mixed();
  const Settings s = wave_settings();
  WaveRun oracle(scene, {s, kReferenceLanes, 1});
  oracle.all(64);
  WaveRun run(scene, {s, lane_widths().back(), 16});
  run.all(512);
  const Counts &a = oracle.reference_counts(), &b = run.wave().counts;
  EXPECT_EQ(a.samples, uint64_t{s.width} * s.height * s.spp);
  EXPECT_EQ(a.samples, b.samples);
  EXPECT_EQ(a.rays, b.rays);
  EXPECT_EQ(a.shadow_rays, b.shadow_rays);
  EXPECT_EQ(a.records, b.records);
  EXPECT_GE(b.packet_lanes, b.records);
  // Reduced builds shade most programs in scalar lanes.
  if (WAVECOMB_REDUCED_KERNELS)
    EXPECT_LE(b.packet_lanes, b.packets * lane_widths().back());
  else
    EXPECT_EQ(b.packet_lanes, b.packets * lane_widths().back());
  EXPECT_GT(run.wave().bytes(), 512u * 100);
}

}  // namespace
}  // namespace wavecomb
