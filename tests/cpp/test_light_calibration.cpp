// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/render/pilots/light_calibration.h"

#include <cmath>
#include <numeric>

#include "scene_testing.h"
#include "wavecomb/light/description/light_builder.h"

namespace wavecomb {
namespace {

using namespace scene_testing;

Settings small() {
  Settings s;
  s.width = 32;
  s.height = 24;
  s.spp = 1;
  s.max_depth = 3;
  return s;
}

Light named(LightKind kind, const Vec3<float>& color, const Affine& to_world, const char* name) {
  Light light = make_light(kind, color, to_world);
  light.name = name;
  return light;
}

/// Makes a floor with a key and a fill light and a uniform dome, a light below the floor, and an
/// emissive box. `dome` and `key` are radiances.
SceneBuilder stage(float dome = 0.12f, float key = 13, float hidden = 300) {
  SceneBuilder b;
  const uint32_t white = b.add_material(make_material(ProgramId::kDiffuse, {0.6f, 0.6f, 0.6f}));
  const uint32_t glow = b.add_material(glowing(0.2f, 0.5f));
  const auto add = [&](const MeshData& m, uint32_t material, const char* name) {
    b.add_to_group(0, b.add_mesh(make_mesh(m, material, name)));
  };
  add(ground(10), white, "Floor");
  add(box({-1, 0, -1}, {1, 2, 1}), white, "Box");
  add(box({3, 0, 0}, {3.5f, 0.5f, 0.5f}), glow, "Glow");
  b.add_light(named(LightKind::kDome, Vec3<float>(dome), {}, "Dome"));
  b.add_light(
      named(LightKind::kRect, Vec3<float>(key), translate(-3, 9, 4) * rotate(0, -70), "Key"));
  b.add_light(named(LightKind::kRect, {2, 2, 2}, translate(5, 7, 5) * rotate(0, -60), "Fill"));
  b.add_light(
      named(LightKind::kRect, Vec3<float>(hidden), translate(0, -2, 0) * rotate(0, -90), "Below"));
  b.set_camera(make_camera({0, 6, 12}, {0, 0, 0}, 1));
  return b;
}

LightShares shares_of(WavefrontRenderer& renderer, const Settings& settings) {
  renderer.render(settings);
  return renderer.statistics().light_calibration;
}
LightShares shares_of(const ScenePtr& scene, const Settings& settings) {
  WavefrontRenderer renderer(scene, 1);
  return shares_of(renderer, settings);
}
double share_of(const LightShares& shares, const std::string& name) {
  for (const LightShare& part : shares.parts)
    if (part.name == name) return part.share;
  ADD_FAILURE() << "no " << name;
  return 0;
}
double sum_of(const LightShares& shares) {
  return std::accumulate(shares.parts.begin(), shares.parts.end(), 0.0,
                         [](double sum, const LightShare& part) { return sum + part.share; });
}
void expect_same(const LightShares& a, const LightShares& b, const std::string& what) {
  EXPECT_EQ(a.paths, b.paths) << what;
  EXPECT_EQ(a.tilted_nodes, b.tilted_nodes) << what;
  ASSERT_EQ(a.parts.size(), b.parts.size()) << what;
  for (size_t i = 0; i < a.parts.size(); ++i) {
    EXPECT_EQ(a.parts[i].name, b.parts[i].name) << what;
    EXPECT_EQ(a.parts[i].share, b.parts[i].share) << what << ": " << a.parts[i].name;
  }
}

TEST(LightCalibration, GivesSharesToWhatLights) {
  const LightShares shares = shares_of(stage().build(), small());
  ASSERT_EQ(shares.parts.size(), 5u);
  EXPECT_EQ(shares.paths, 1024u);
  EXPECT_NEAR(sum_of(shares), 1, 1e-6);
  EXPECT_GT(share_of(shares, "Key"), 0.6);
  EXPECT_LT(share_of(shares, "Dome"), 0.1);
  EXPECT_GT(share_of(shares, "Fill"), share_of(shares, "Glow"));
  // The light below the floor has the most power but illuminates no visible surface, so it gets the
  // minimum selection probability.
  double by_power = 0;
  for (const LightShare& part : shares.parts)
    if (part.name == "Below") by_power = part.by_power;
  EXPECT_GT(by_power, 0.4);
  EXPECT_NEAR(share_of(shares, "Below"), 0.1 * (0.1 + 0.5 * by_power), 0.005);
}

TEST(LightCalibration, IsOfTheWholePictureAndNothingElse) {
  const ScenePtr scene = stage().build();
  for (const LightSelection selection : {LightSelection::kAuto, LightSelection::kTree}) {
    Settings s = small();
    s.light_selection = selection;
    const LightShares expected = shares_of(scene, s);
    EXPECT_GT(expected.paths, 0u);
    Settings other = s;
    other.threads = 3;
    other.wave_size = 64;
    other.lanes = 1;
    other.seed = 17;
    other.spp = 5;
    other.policy = "material";
    other.sampler = SamplerKind::kIndependent;
    other.region = Region{3, 4, 9, 8};
    expect_same(expected, shares_of(scene, other), "other schedule, samples and region");
    other = s;
    other.integrator = IntegratorKind::kReference;
    expect_same(expected, shares_of(scene, other), "reference integrator");
    other = s;
    other.height = 31;
    if (selection == LightSelection::kAuto) {
      EXPECT_NE(share_of(expected, "Key"), share_of(shares_of(scene, other), "Key"));
    }
  }
}

TEST(LightCalibration, APartIsThatOfTheWholePicture) {
  WavefrontRenderer renderer(stage().build(), 1);
  Settings s = small();
  s.spp = 4;
  const RenderedImage whole = renderer.render(s);
  s.region = Region{8, 6, 20, 15};
  const RenderedImage part = renderer.render(s);
  for (uint32_t y = 6; y < 15; ++y)
    for (uint32_t i = 3 * (y * s.width + 8); i < 3 * (y * s.width + 20); ++i)
      ASSERT_EQ(part.beauty[i], whole.beauty[i]);
}

TEST(LightCalibration, IsKeptUntilItIsAnother) {
  WavefrontRenderer renderer(stage().build(), 1);
  Settings s = small();
  const LightShares first = shares_of(renderer, s);
  EXPECT_FALSE(first.kept);
  s.seed = 4;
  const LightShares again = shares_of(renderer, s);
  EXPECT_TRUE(again.kept);
  expect_same(first, again, "again");
  s.width = 40;
  EXPECT_FALSE(shares_of(renderer, s).kept);
  // Calibration gives the same result for an edited scene and for a scene built with the same
  // values.
  Light key = renderer.scene()->lights()[1];
  ASSERT_EQ(key.name, "Key");
  key.color = {2, 2, 2};
  SceneEdit edit;
  edit.lights[1] = key;
  renderer.edit(edit);
  const LightShares edited = shares_of(renderer, s);
  EXPECT_FALSE(edited.kept);
  expect_same(edited, shares_of(stage(0.12f, 2).build(), s), "edited");
  SceneEdit moved;
  moved.camera = make_camera({9, 2, 0}, {0, 0, 0}, 1);
  renderer.edit(moved);
  EXPECT_FALSE(shares_of(renderer, s).kept);
}

TEST(LightCalibration, IsLeftOutWhereThereIsNothingToShare) {
  EXPECT_EQ(shares_of(cornell(), small()).paths, 0u) << "one light";
  Settings s = small();
  s.light_weights = LightWeights::kPower;
  EXPECT_EQ(shares_of(stage().build(), s).paths, 0u);
  s = small();
  s.max_depth = 0;
  EXPECT_EQ(shares_of(stage().build(), s).paths, 0u);
  SceneBuilder dark;
  dark.add_to_group(0, dark.add_mesh(make_mesh(ground(1))));
  dark.set_camera(make_camera({0, 1, 2}, {0, 0, 0}));
  EXPECT_EQ(shares_of(dark.build(), small()).paths, 0u);
  for (int i = 0; i < 3; ++i) {
    dark = SceneBuilder();
    dark.add_to_group(0, dark.add_mesh(make_mesh(ground(1))));
    dark.set_camera(make_camera({0, 1, 2}, {0, 0, 0}));
    for (int k = 0; k < i; ++k) dark.add_light(make_light(LightKind::kDome, {0, 0, 0}));
    dark.add_light(make_light(LightKind::kSphere, {0, 0, 0}, translate(0, 2, 0)));
    EXPECT_EQ(shares_of(dark.build(), small()).paths, 0u) << "black lights";
  }
}

/// Returns the number of shadow rays in an image of a dark box under lights of `scale` times their
/// usual radiance: a rect light and, if `dome` is set, a dome.
uint64_t shadow_rays(const Settings& settings, float scale, bool dome) {
  SceneBuilder b;
  const auto add = [&](const MeshData& m, float albedo) {
    const uint32_t material =
        b.add_material(make_material(ProgramId::kDiffuse, Vec3<float>(albedo)));
    b.add_to_group(0, b.add_mesh(make_mesh(m, material, "mesh")));
  };
  add(ground(10), 0.6f);
  add(box({-2, 0, -2}, {2, 2, 2}), 0.02f);
  b.add_light(
      make_light(LightKind::kRect, Vec3<float>(13 * scale), translate(-3, 9, 4) * rotate(0, -70)));
  if (dome) b.add_light(make_light(LightKind::kDome, Vec3<float>(0.1f * scale)));
  b.set_camera(make_camera({0, 6, 12}, {0, 0, 0}, 1));
  WavefrontRenderer renderer(b.build(), 1);
  renderer.render(settings);
  return renderer.statistics().shadow_rays;
}

TEST(ShadowRoulette, SavesRaysWhateverTheUnitOfLight) {
  Settings s = small();
  s.spp = 8;
  s.max_depth = 6;
  for (const bool dome : {false, true}) {
    const uint64_t saving = shadow_rays(s, 1, dome);
    Settings all = s;
    all.shadow_roulette = false;
    const uint64_t without = shadow_rays(all, 1, dome);
    EXPECT_LT(saving, without - without / 20) << "dome: " << dome;
    EXPECT_GT(saving, without / 2) << "dome: " << dome;
    // Scaling by a power of two is exact, so the same shadow rays are traced.
    EXPECT_EQ(shadow_rays(s, 0x1p-6f, dome), saving) << "dome: " << dome;
    EXPECT_EQ(shadow_rays(all, 0x1p-6f, dome), without) << "dome: " << dome;
    // Without calibrated light weights, no brightness is known.
    s.light_weights = all.light_weights = LightWeights::kPower;
    EXPECT_EQ(shadow_rays(s, 1, dome), shadow_rays(all, 1, dome)) << "dome: " << dome;
    s.light_weights = LightWeights::kCalibrated;
  }
}

TEST(LightCalibration, StandsWhatStagesBring) {
  const auto expect_sane = [](const ScenePtr& scene, const Settings& s, const char* what) {
    for (const LightSelection selection : {LightSelection::kPower, LightSelection::kTree}) {
      Settings settings = s;
      settings.light_selection = selection;
      WavefrontRenderer renderer(scene, 1);
      const RenderedImage image = renderer.render(settings);
      for (const float value : image.beauty) ASSERT_TRUE(std::isfinite(value)) << what;
      const LightShares shares = renderer.statistics().light_calibration;
      EXPECT_GT(shares.paths, 0u) << what;
      EXPECT_NEAR(sum_of(shares), 1, 1e-5) << what;
      for (const LightShare& part : shares.parts) EXPECT_GT(part.share, 0) << what;
    }
  };
  Settings pixel = small();
  pixel.width = pixel.height = 1;
  expect_sane(stage().build(), pixel, "one pixel");
  expect_sane(stage(1e30f).build(), small(), "a dome too bright for float");
  expect_sane(stage(0.1f, 1e30f).build(), small(), "a lamp too bright for float");
  expect_sane(stage(1e-30f, 1e-30f, 1e-30f).build(), small(), "lights too dim for float");
  SceneBuilder away = stage();
  away.set_camera(make_camera({0, 6, 12}, {0, 20, 40}, 1));
  expect_sane(away.build(), small(), "nothing in sight but the dome");
  SceneBuilder alone = stage(0, 13);
  alone.set_camera(make_camera({0, 6, 12}, {0, 20, 40}, 1));
  expect_sane(alone.build(), small(), "nothing in sight");
  SceneBuilder many = stage();
  for (int i = 0; i < 3000; ++i)
    many.add_light(make_light(i % 3 ? LightKind::kSphere : LightKind::kDistant,
                              Vec3<float>(i % 7 ? 0.01f : 0.f),
                              translate(static_cast<float>(i % 50) - 25.f, 3, 0)));
  const ScenePtr crowd = many.build();
  expect_sane(crowd, small(), "many lights");
  Settings s = small();
  s.light_selection = LightSelection::kPower;
  const LightShares shares = shares_of(crowd, s);
  EXPECT_EQ(shares.parts.size(), LightParts::kMax);
  EXPECT_NE(shares.parts.back().name.find("others"), std::string::npos);
}

TEST(LightParts, AreAllLightsThatShine) {
  SceneBuilder b = stage();
  b.add_light(named(LightKind::kSphere, {0, 0, 0}, translate(0, 5, 0), "Black"));
  const ScenePtr scene = b.build();
  const LightSet& set = scene->light_set();
  const LightParts parts = divide_lights(*scene, false);
  ASSERT_EQ(parts.size(), 5u);
  EXPECT_NEAR(std::accumulate(parts.power.begin(), parts.power.end(), 0.0), 1, 1e-6);
  std::vector<double> sums(parts.size(), 0);
  for (uint32_t i = 0; i < set.size(); ++i) {
    const uint32_t part = parts.of(i);
    if (part == kNoPart)
      EXPECT_EQ(set.selection_pdf(i), 0.f);
    else
      sums[part] += static_cast<double>(set.selection_pdf(i));
  }
  for (size_t i = 0; i < parts.size(); ++i) EXPECT_NEAR(sums[i], parts.power[i], 1e-6);
  EXPECT_EQ(parts.of(kNoLight), kNoPart);

  const std::vector<double> wanted{0.1, 0.2, 0.3, 0.05, 0.35};
  const CalibratedLights tables = LightTableBuilder(set, set.tree, parts).build_tables(wanted, {});
  double sum = 0;
  for (size_t i = 0; i < parts.size(); ++i) {
    EXPECT_NEAR(tables.shares[i], wanted[i], 0.01) << parts.names[i];
    sum += tables.shares[i];
  }
  EXPECT_NEAR(sum, 1, 1e-12) << "in integers";
  ASSERT_EQ(tables.selection_pdf.size(), set.size());
  for (uint32_t i = 0; i < set.size(); ++i)
    EXPECT_EQ(tables.selection_pdf[i] > 0, set.selection_pdf(i) > 0);
}

TEST(LightParts, TheTreeIsOne) {
  const ScenePtr scene = stage().build();
  const LightSet& set = scene->light_set();
  const LightParts parts = divide_lights(*scene, true);
  ASSERT_EQ(parts.size(), 2u);
  EXPECT_EQ(parts.names.back(), "tree");
  EXPECT_EQ(parts.of(kNoLight), 1u);
  EXPECT_EQ(parts.of(0), 0u);
  for (uint32_t i = 1; i < set.size(); ++i) EXPECT_EQ(parts.of(i), 1u);
  const NodeTilt tilt{0, 4};
  const CalibratedLights tables = LightTableBuilder(set, scene->light_tree(1), parts)
                                      .build_tables(std::vector<double>{0.25, 0.75}, {&tilt, 1});
  LightView view = scene->view().lights;
  view.tree = scene->light_tree(1).view();
  const LightTreeNode before = view.tree.nodes[0];
  tables.apply(view);
  EXPECT_NEAR(tables.shares[1], 0.75, 1e-6);
  EXPECT_EQ(view.tree.infinite_ends[0], 1u << 24);
  EXPECT_EQ(view.tree.infinite_pdf[0],
            static_cast<float>((1u << 24) - view.tree.numbers) * 0x1p-24f);
  const LightTreeNode& after = view.tree.nodes[0];
  EXPECT_FLOAT_EQ(after.child[1].intensity / after.child[0].intensity,
                  4 * before.child[1].intensity / before.child[0].intensity);
}

}  // namespace
}  // namespace wavecomb
