// SPDX-License-Identifier: Apache-2.0
/// Tests of scene edits, copies, stop() and pick(). An edited scene must equal a newly built scene
/// with the same values.
#include <atomic>
#include <chrono>
#include <functional>
#include <thread>
#include <type_traits>

#include "scene_testing.h"
#include "wavecomb/accel/embree_accelerator.h"
#include "wavecomb/render/inspection/picking.h"
#include "wavecomb/render/renderer.h"
#include "wavecomb/render/statistics/cost_profile.h"
#include "wavecomb/scene/moves.h"
#include "wavecomb/scene/names.h"

namespace wavecomb {
namespace {

using namespace scene_testing;
using Clock = std::chrono::steady_clock;

struct Values {
  std::vector<Material> materials;
  std::vector<Light> lights;
  Camera camera;
};

enum MaterialNumber : uint32_t { kFloor, kLeaf, kLamp, kGlossy };
enum LightNumber : uint32_t { kSky, kPanel, kBulb };

Values values() {
  Values v;
  v.materials.push_back(make_material(ProgramId::kDiffuse, {0.6f, 0.5f, 0.4f}));
  v.materials.push_back(make_material(ProgramId::kPrincipled, {0.3f, 0.6f, 0.2f}, 0.7f));
  v.materials.back().presence = true;
  v.materials.push_back(make_material(ProgramId::kPrincipled, {0.2f, 0.2f, 0.2f}));
  v.materials.push_back(make_material(ProgramId::kPrincipled, {0.7f, 0.3f, 0.2f}, 0.3f));
  v.lights.push_back(make_light(LightKind::kDome, {0.4f, 0.4f, 0.5f}));
  v.lights.push_back(
      make_light(LightKind::kRect, {8, 8, 6}, translate(0, 2.5f, 0.5f) * rotate(0, -80)));
  v.lights.push_back(make_light(LightKind::kSphere, {9, 3, 3}, translate(-1.5f, 1.4f, 0.5f)));
  v.lights.back().radius = 0.2f;
  v.camera = make_camera({0.4, 0.8, 4.5}, {0, -0.2, 0}, 0.8f);
  return v;
}

/// Transforms of four moved meshes: the floor, the mesh with face materials (which is mirrored),
/// the first ball and the panel.
struct Placing {
  Affine floor, cut, ball, panel;
};

/// Makes a scene with instances that inherit materials, a mesh with face materials, and a mesh of
/// the world. If `placing` is not null, meshes of the world become instances with the given
/// transforms, which follow all other instances.
ScenePtr build(const Values& v, const Placing* placing = nullptr) {
  SceneBuilder b;
  const uint32_t sky = add_texture(b, 16, 8, 3, random_texels(16 * 8 * 3, 0.f, 1.5f, 4));
  const uint32_t mask = add_texture(b, 8, 8, 1, random_texels(64, -0.2f, 1.2f, 6));
  for (uint32_t m = 0; m < v.materials.size(); ++m) {
    Material material = v.materials[m];
    material.name = "/World/Material" + std::to_string(m);
    if (m == kLamp) material.textures[static_cast<size_t>(Input::kRoughness)] = use(mask, 0);
    b.add_material(material);
  }
  const uint32_t floor = b.add_mesh(make_mesh(ground(4, -1), kFloor, "/World/Floor"));
  MeshData cut = quad({-1, -1, 1.2f}, {2, 0, 0}, {0, 1, 0});
  cut.face_materials = {kLeaf, kGlossy};
  const uint32_t card = b.add_mesh(make_mesh(cut, kInheritMaterial, "/World/Cut"));
  for (const uint32_t mesh : {floor, card})
    if (!placing) b.add_to_group(0, mesh);
  const uint32_t ball = b.add_group("ball", "/World/Ball");
  b.add_to_group(ball,
                 b.add_mesh(make_mesh(sphere(6, true), kInheritMaterial, "/World/Ball/Mesh")));
  const uint32_t pair = b.add_group("pair", "/World/Pair");
  b.add_to_group(pair, b.add_mesh(make_mesh(box({-1, -1, -1}, {1, 1, 1}), kLamp, "/World/Pair/A")));
  b.add_to_group(pair, b.add_mesh(make_mesh(sphere(4, false).transform(translate(0, 1.8f, 0)),
                                            kLeaf, "/World/Pair/B")));
  const Affine first = translate(-1, -0.4f, 0) * scale(0.5f, 0.5f, 0.5f);
  b.add_instance(0, ball, placing ? placing->ball * first : first, kGlossy,
                 b.add_placement_name("/World/First", 0));
  b.add_instance(0, ball, translate(0.1f, -0.5f, 0.3f) * scale(-0.4f, 0.4f, 0.4f), kLeaf);
  b.add_instance(0, pair, translate(1, -0.5f, -0.3f) * rotate(1, 30) * scale(0.4f, 0.3f, 0.4f));
  if (placing) {
    const uint32_t floors = b.add_group("floors"), cards = b.add_group("cards");
    b.add_to_group(floors, floor);
    b.add_to_group(cards, card);
    b.add_instance(0, cards, placing->cut);
    b.add_instance(0, floors, placing->floor);
  }
  for (uint32_t i = 0; i < v.lights.size(); ++i) {
    Light light = v.lights[i];
    if (placing && i == kPanel) light.to_world = placing->panel * light.to_world;
    light.name = "/World/Light" + std::to_string(i);
    if (i == kSky) light.texture = sky;
    b.add_light(light);
  }
  b.set_camera(v.camera);
  return b.build();
}

struct Change {
  std::string what;
  std::function<void(Values&)> apply;
  std::vector<uint32_t> materials{}, lights{};
  bool camera = false;
  bool keeps_hierarchy = true;
};

const std::vector<Change>& changes() {
  static const std::vector<Change> all = {
      {"camera",
       [](Values& v) { v.camera = make_camera({1, 1.2, 4}, {0, -0.3, 0}, 0.9f); },
       {},
       {},
       true},
      {"colour", [](Values& v) { v.materials[kFloor].base_color = {0.1f, 0.4f, 0.7f}; }, {kFloor}},
      {"begins to emit", [](Values& v) { v.materials[kLamp].emission = {2, 1, 0.5f}; }, {kLamp}},
      {"another begins", [](Values& v) { v.materials[kGlossy].emission = {0, 1, 2}; }, {kGlossy}},
      {"emits more", [](Values& v) { v.materials[kLamp].emission = {5, 5, 1}; }, {kLamp}},
      {"light colours",
       [](Values& v) {
         v.lights[kSky].color = {0.1f, 0.2f, 0.1f};
         v.lights[kPanel].color = {1, 2, 30};
       },
       {},
       {kSky, kPanel}},
      {"a dark light", [](Values& v) { v.lights[kBulb].color = {0, 0, 0}; }, {}, {kBulb}},
      {"opacity below 1",
       [](Values& v) { v.materials[kLeaf].opacity = 0.4f; },
       {kLeaf},
       {},
       false,
       false},
      {"opacity elsewhere", [](Values& v) { v.materials[kLeaf].opacity = 0.7f; }, {kLeaf}},
      {"ceases to emit",
       [](Values& v) {
         v.materials[kLamp].emission = {0, 0, 0};
         v.materials[kLamp].roughness = 0.1f;
       },
       {kLamp}},
      {"light moves",
       [](Values& v) { v.lights[kBulb].to_world = translate(1.4f, 0.6f, 0.8f); },
       {},
       {kBulb},
       false,
       false},
      {"panel grows", [](Values& v) { v.lights[kPanel].width = 2; }, {}, {kPanel}, false, false},
      {"opacity 1 again",
       [](Values& v) { v.materials[kLeaf].opacity = 1; },
       {kLeaf},
       {},
       false,
       false},
      {"nothing glows", [](Values& v) { v.materials[kGlossy].emission = {0, 0, 0}; }, {kGlossy}},
      {"all at once",
       [](Values& v) {
         v.camera.lens_radius = 0.05f;
         v.camera.focus_distance = 4;
         v.materials[kLeaf].opacity_threshold = 0.5f;
         v.materials[kLeaf].opacity = 0.2f;
         v.materials[kFloor].base_color = {0.9f, 0.9f, 0.9f};
         v.lights[kBulb].color = {20, 20, 20};
       },
       {kFloor, kLeaf},
       {kBulb},
       true,
       false},
  };
  return all;
}

SceneEdit edit_for(const Change& change, const Scene& scene, const Values& v) {
  SceneEdit edit;
  if (change.camera) edit.camera = v.camera;
  for (const uint32_t m : change.materials) {
    Material& material = edit.materials[m] = v.materials[m];
    material.name = scene.materials()[m].name;
    material.textures = scene.materials()[m].textures;
  }
  for (const uint32_t i : change.lights) {
    Light& light = edit.lights[i] = v.lights[i];
    light.name = scene.lights()[i].name;
    light.texture = scene.lights()[i].texture;
  }
  return edit;
}

Settings small() {
  Settings s;
  s.width = 48;
  s.height = 32;
  s.spp = size_for_build(8, 4);
  s.aovs = AovSet{static_cast<uint32_t>(Aov::kDepth) | static_cast<uint32_t>(Aov::kMaterialId) |
                  static_cast<uint32_t>(Aov::kDirect)};
  return s;
}

TEST(Edits, AnEditedSceneIsTheSceneBuiltAnew) {
  Values v = values();
  WavefrontRenderer renderer(build(v));
  RenderedImage before = renderer.render(small());
  uint64_t version = 0;
  for (const Change& change : changes()) {
    change.apply(v);
    renderer.edit(edit_for(change, *renderer.scene(), v));
    EXPECT_EQ(renderer.version(), ++version);
    const RenderedImage edited = renderer.render(small());
    expect_same_image(edited, WavefrontRenderer(build(v)).render(small()), change.what);
    EXPECT_NE(edited.beauty, before.beauty) << change.what << ": or it would show nothing";
    before = edited;
  }
}

bool same_transform(const Affine& a, const Affine& b) {
  const MatrixStep x(a), y(b);
  return std::ranges::equal(x.to_world, y.to_world);
}

TEST(Edits, AMovedSceneIsTheSceneBuiltAnew) {
  Values v = values();
  v.materials[kLamp].emission = {2, 1, 0.5f};
  v.materials[kGlossy].emission = {0.5f, 0.1f, 0.1f};
  const Affine identity{};
  const Affine down = translate(0, -0.2f, 0) * rotate(2, 5), up = translate(0.3f, 0.5f, 0.2f),
               mirror = translate(0, 0.4f, -0.8f) * scale(-0.5f, 0.5f, 1), all = rotate(1, 20);
  struct Step {
    std::string what;
    std::map<std::string, Affine> moves;
    Placing placing;
  };
  const std::vector<Step> steps = {
      {"floor", {{"/World/Floor", down}}, {down, identity, identity, identity}},
      {"an instance too", {{"/World/First", up}}, {down, identity, up, identity}},
      {"a light too", {{"/World/Light1", up}}, {down, identity, up, up}},
      {"back", {{"/World/First", identity}}, {down, identity, identity, up}},
  };
  WavefrontRenderer renderer(build(v));
  RenderedImage before = renderer.render(small());
  for (const Step& step : steps) {
    renderer.edit({.moves = step.moves});
    const RenderedImage edited = renderer.render(small());
    expect_same_image(edited, WavefrontRenderer(build(v, &step.placing)).render(small()),
                      step.what);
    EXPECT_NE(edited.beauty, before.beauty) << step.what;
    before = edited;
  }
  // A mirrored mesh.
  WavefrontRenderer other(build(v));
  other.edit({.moves = {{"/World/Cut", mirror}, {"/World/Floor", identity}}});
  const Placing cut{identity, mirror, identity, identity};
  expect_same_image(other.render(small()), WavefrontRenderer(build(v, &cut)).render(small()),
                    "cut");
  EXPECT_EQ(ObjectNames(*other.scene()).asset(4), "/World/Cut");
  const Moves nested{{"/World", all}, {"/World/Floor", down}};
  EXPECT_TRUE(same_transform(move_of(nested, "/World/Floor"), all * down));
  EXPECT_TRUE(same_transform(move_of(nested, "/World/Floors"), all));
}

TEST(Edits, MovesThatAreRefused) {
  WavefrontRenderer renderer(build(values()));
  const auto complaint = [&](const std::string& path, const Affine& m) -> std::string {
    try {
      renderer.edit({.moves = {{path, m}}});
    } catch (const Error& e) {
      return e.what();
    }
    return "";
  };
  EXPECT_NE(complaint("/World/Flor", {}).find("/World/Flor"), std::string::npos);
  EXPECT_NE(complaint("/World/Floor", scale(1, 0, 1)).find("singular"), std::string::npos);
  EXPECT_NE(complaint("[2]/A", {}).find("part of an instance"), std::string::npos);
  EXPECT_EQ(renderer.version(), 0u);
}

TEST(Edits, ShareWhatDidNotChange) {
  Values v = values();
  ScenePtr scene = build(v);
  auto accel = std::make_unique<EmbreeAccelerator>(scene, 1u);
  for (const Change& change : changes()) {
    change.apply(v);
    const ScenePtr edited = scene->edited(edit_for(change, *scene, v));
    EXPECT_EQ(edited->geometry(), scene->geometry()) << change.what;
    if (change.materials.empty()) {
      EXPECT_EQ(edited->material_part(), scene->material_part()) << change.what;
    }
    if (change.what == "colour" || change.what == "camera") {
      EXPECT_EQ(edited->light_part(), scene->light_part()) << change.what;
    }
    auto next = std::make_unique<EmbreeAccelerator>(edited, *accel, 1);
    EXPECT_EQ(next->embree_scene() == accel->embree_scene(), change.keeps_hierarchy) << change.what;
    scene = edited;
    accel = std::move(next);
  }
}

TEST(Edits, RefuseWhatBuildersRefuse) {
  WavefrontRenderer renderer(build(values()));
  const ScenePtr before = renderer.scene();
  const auto complaint = [&](const std::function<void(SceneEdit&)>& change) -> std::string {
    SceneEdit edit;
    edit.camera = before->camera();
    edit.materials[kFloor] = before->materials()[kFloor];
    edit.lights[kPanel] = before->lights()[kPanel];
    change(edit);
    try {
      renderer.edit(edit);
    } catch (const Error& e) {
      return e.what();
    }
    return "";
  };
  const auto expect_refused = [&](const std::string& part, const auto& change) {
    EXPECT_NE(complaint(change).find(part), std::string::npos) << part << ": " << complaint(change);
  };
  expect_refused("/World/Material0", [](SceneEdit& e) { e.materials[kFloor].roughness = kNan; });
  expect_refused("ior", [](SceneEdit& e) { e.materials[kFloor].ior = 0; });
  expect_refused("/World/Light1", [](SceneEdit& e) { e.lights[kPanel].color.y = -1; });
  expect_refused("camera", [](SceneEdit& e) { e.camera->window[0] = 9; });
  expect_refused("material 99", [](SceneEdit& e) { e.materials[99] = {}; });
  expect_refused("light 3", [](SceneEdit& e) { e.lights[3] = {}; });
  expect_refused("light group 7", [](SceneEdit& e) { e.lights[kPanel].group = 7; });
  EXPECT_EQ(renderer.scene(), before) << "all or nothing";
  EXPECT_EQ(renderer.version(), 0u);
}

TEST(Twins, RenderAtOnceEachItsOwnMaterials) {
  Values v = values();
  v.materials[kLeaf].opacity = 0.5f;
  WavefrontRenderer renderer(build(v));
  const auto clone = renderer.clone();
  Values other = v;
  other.materials[kLeaf].opacity = 0.2f;
  other.materials[kFloor].base_color = {0, 1, 0};
  const Change change{"twin", {}, {kLeaf, kFloor}};
  clone->edit(edit_for(change, *clone->scene(), other));
  EXPECT_EQ(renderer.version(), 0u);
  Settings s = small();
  s.threads = 2;
  RenderedImage ours, theirs;
  std::thread thread([&] {
    for (int i = 0; i < 3; ++i) theirs = clone->render(s);
  });
  for (int i = 0; i < 3; ++i) ours = renderer.render(s);
  thread.join();
  expect_same_image(ours, WavefrontRenderer(build(v)).render(s), "origin");
  expect_same_image(theirs, WavefrontRenderer(build(other)).render(s), "twin");
  EXPECT_NE(ours.beauty, theirs.beauty);
}

TEST(Twins, OutliveTheirOrigin) {
  auto renderer = std::make_unique<WavefrontRenderer>(build(values()));
  const RenderedImage before = renderer->render(small());
  const auto clone = renderer->clone();
  renderer.reset();
  expect_same_image(clone->render(small()), before, "twin");
}

TEST(Stop, EndsARenderFromAnotherThread) {
  WavefrontRenderer renderer(cornell());
  renderer.stop();
  Settings s;
  s.width = s.height = 256;
  s.spp = 1u << 16;  // would take hours
  s.threads = 2;
  std::atomic<bool> looked{false}, refused{false};
  Clock::time_point asked;
  std::thread other([&] {
    while (!looked) std::this_thread::sleep_for(std::chrono::milliseconds(1));
    try {
      renderer.edit({.camera = renderer.scene()->camera()});
    } catch (const Error&) {
      refused = true;
    }
    EXPECT_TRUE(renderer.pick(128, 128, 256, 256)) << "while the render goes on";
    asked = Clock::now();
    renderer.stop();
  });
  const RenderedImage p = renderer.render(s, {.progress =
                                                  [&](const RenderStatus&) {
                                                    looked = true;
                                                    return Request::kContinue;
                                                  },
                                              .interval_s = 0.01});
  const double took = std::chrono::duration<double>(Clock::now() - asked).count();
  other.join();
  EXPECT_LT(took, kSanitized ? 20 : 1) << "seconds";
  EXPECT_TRUE(refused) << "no edits while a render goes on";
  EXPECT_TRUE(renderer.statistics().cancelled);
  EXPECT_EQ(p.samples.size(), 256u * 256);
  Settings quick = small();
  renderer.render(quick);
  EXPECT_FALSE(renderer.statistics().cancelled) << "a stop is of one render";
}

static_assert(
    std::is_same_v<RenderStatistics, decltype(std::declval<WavefrontRenderer&>().statistics())> &&
        std::is_same_v<CostProfile, decltype(std::declval<WavefrontRenderer&>().cost_profile())>,
    "another thread may replace them: callers get copies");

/// Copies statistics while another thread replaces them, so that the thread sanitizer can detect
/// races.
TEST(Renderer, StatisticsAreReadWhileAnotherThreadRenders) {
  WavefrontRenderer renderer(cornell());
  Settings s = small();
  renderer.render(s);
  const RenderStatistics first = renderer.statistics();
  std::atomic<bool> done = false;
  std::thread other([&] {
    while (!done) {
      const RenderStatistics now = renderer.statistics();
      EXPECT_EQ(now.samples, first.samples);
      EXPECT_GE(renderer.cost_profile().materials.size(), 0u);
    }
  });
  for (int i = 0; i < 20; ++i) renderer.render(s);
  done = true;
  other.join();
}

TEST(Progressive, IsTheSamePictureInShortPasses) {
  WavefrontRenderer renderer(cornell());
  Settings s = small();
  s.spp = 24;
  const RenderedImage plain = renderer.render(s);
  EXPECT_EQ(renderer.statistics().passes, 2u);
  s.progressive = true;
  expect_same_image(renderer.render(s), plain, "progressive");
  EXPECT_EQ(renderer.statistics().passes, 6u) << "1, 1, 2, 4, 8, 8";
  s.noise = 0.05f;
  s.spp = 128;
  const RenderedImage adaptive = renderer.render(s);
  s.progressive = false;
  expect_same_image(renderer.render(s), adaptive, "adaptive");
}

TEST(RegionSetting, HasThePixelsOfTheWholePicture) {
  WavefrontRenderer renderer(mixed());
  Settings s = small();
  const RenderedImage whole = renderer.render(s);
  s.region = Region{5, 3, 41, 19};
  uint64_t total = 0;
  const auto look = [&](const RenderStatus& status) {
    total = status.samples_total;
    EXPECT_EQ(status.active_pixels, 36u * 16);
    return Request::kContinue;
  };
  const RenderedImage part = renderer.render(s, {.progress = look});
  EXPECT_EQ(total, uint64_t{36} * 16 * s.spp);
  EXPECT_EQ(renderer.statistics().samples, total);
  const AovLayer &direct = layer(part, "direct"), &all = layer(whole, "direct");
  for (uint32_t y = 0; y < s.height; ++y)
    for (uint32_t x = 0; x < s.width; ++x) {
      const size_t i = size_t{y} * s.width + x;
      const bool inside = s.region->contains(x, y);
      ASSERT_EQ(part.samples[i], inside ? s.spp : 0u) << x << " " << y;
      for (size_t c = 3 * i; c < 3 * i + 3; ++c) {
        ASSERT_EQ(part.beauty[c], inside ? whole.beauty[c] : 0.f) << x << " " << y;
        ASSERT_EQ(direct.values[c], inside ? all.values[c] : 0.f) << x << " " << y;
      }
    }
}

TEST(RegionSetting, AdaptiveRendersStayWithin) {
  WavefrontRenderer renderer(cornell());
  Settings s = small();
  s.region = Region{8, 8, 40, 24};
  s.noise = 0.05f;
  s.spp = 256;
  const RenderedImage part = renderer.render(s);
  EXPECT_LE(renderer.statistics().error, 0.05);
  uint32_t most = 0;
  for (uint32_t i = 0; i < part.samples.size(); ++i) {
    const bool inside = s.region->contains(i % s.width, i / s.width);
    EXPECT_EQ(part.samples[i] > 0, inside);
    most = std::max(most, part.samples[i]);
  }
  EXPECT_GT(most, 16u) << "or nothing was decided";
}

TEST(Costs, AWholeProfileSparesCalibration) {
  WavefrontRenderer renderer(mixed());
  renderer.render(small());
  EXPECT_GT(renderer.statistics().calibration_s, 0);
  CostProfile profile = renderer.cost_profile();
  renderer.render(small(), {.profile = &profile});
  EXPECT_EQ(renderer.statistics().calibration_s, 0);
  EXPECT_GT(renderer.statistics().materials[0].calibrated_ns, 0);
  profile.materials.pop_back();
  renderer.render(small(), {.profile = &profile});
  EXPECT_GT(renderer.statistics().calibration_s, 0) << "one that does not know all does not";
}

TEST(Snapshots, HaveEveryLayerOfThePicture) {
  WavefrontRenderer renderer(mixed());
  Settings s = small();
  s.aovs = AovSet{AovSet::kAll};
  s.error = true;
  s.spp = 16;
  std::vector<AovLayer> seen;
  uint64_t samples = 0;
  const char* names[] = {"beauty", "albedo", "normal", "depth", "variance", "error"};
  const auto snapshot = [&](const Snapshot& shot) {
    EXPECT_FALSE(shot.layer("nothing"));
    for (const char* name : names) seen.push_back(shot.layer(name).value());
    for (const std::string& name : s.aovs.names())
      if (const auto one = shot.layer(name);
          one && name != "albedo" && name != "normal" && name != "depth")
        seen.push_back(*one);
    seen.push_back(shot.layer("light_sun").value());
    samples = shot.statistics().samples;
  };
  const RenderedImage p = renderer.render(s, {.snapshot = snapshot});
  EXPECT_EQ(samples, renderer.statistics().samples);
  ASSERT_GT(seen.size(), 15u);
  for (const AovLayer& one : seen) {
    const std::vector<float>& values = one.name == "beauty"     ? p.beauty
                                       : one.name == "albedo"   ? p.albedo
                                       : one.name == "normal"   ? p.normal
                                       : one.name == "depth"    ? p.depth
                                       : one.name == "variance" ? p.variance
                                       : one.name == "error"    ? p.error
                                                                : layer(p, one.name).values;
    expect_same_bits(one.values, values, one.name);
    EXPECT_EQ(one.values.size(), size_t{one.channels} * s.width * s.height) << one.name;
  }
}

TEST(Picks, AgreeWithWhatThePictureShows) {
  const Values v = values();
  WavefrontRenderer renderer(build(v));
  Settings s = small();
  s.spp = 1;
  s.filter = FilterKind::kBox;
  s.filter_width = 0.01f;
  s.aovs = AovSet{AovSet::kAll};
  const RenderedImage p = renderer.render(s);
  const AovLayer &material = layer(p, "material_id"), &instance = layer(p, "instance_id");
  const AovLayer &position = layer(p, "position"), &uv = layer(p, "uv");
  std::map<std::string, int> objects;
  int agree = 0, surfaces = 0;
  for (uint32_t y = 0; y < s.height; ++y)
    for (uint32_t x = 0; x < s.width; ++x) {
      const size_t i = size_t{y} * s.width + x;
      const auto found = renderer.pick(static_cast<float>(x) + 0.5f, static_cast<float>(y) + 0.5f,
                                       s.width, s.height);
      if (found) ++objects[found->object];
      if (!found || found->light != kNoLight) continue;
      ++surfaces;
      const bool same = static_cast<float>(found->material + 1) == material.values[i] &&
                        static_cast<float>(found->instance + 1) == instance.values[i] &&
                        std::abs(found->position.x - position.values[3 * i]) < 0.02f &&
                        std::abs(found->uv.x - uv.values[2 * i]) < 0.02f &&
                        std::abs(found->depth - p.depth[i]) < 0.02f;
      EXPECT_NEAR(found->distance,
                  std::hypot(found->position.x - v.camera.to_world.t.x,
                             found->position.y - v.camera.to_world.t.y,
                             found->position.z - v.camera.to_world.t.z),
                  1e-4);
      agree += same ? 1 : 0;
    }
  EXPECT_GT(surfaces, 500);
  EXPECT_GT(agree, surfaces * 97 / 100) << "edges may differ";
  EXPECT_GT(objects["/World/Floor"], 100);
  EXPECT_GT(objects["/World/Cut"], 20);
  EXPECT_FALSE(renderer.pick(-1000, -4000, s.width, s.height)) << "the sky";
  SceneEdit closer;
  closer.camera = make_camera({-1.5, 1.4, 3}, {-1.5, 1.4, 0.5}, 0.5f);
  renderer.edit(closer);
  const auto bulb = renderer.pick(24, 16, 48, 32);
  ASSERT_TRUE(bulb);
  EXPECT_EQ(bulb->light, static_cast<uint32_t>(kBulb));
  EXPECT_EQ(bulb->object, "/World/Light2");
  EXPECT_NEAR(bulb->distance, 3 - 0.7, 1e-3);
}

}  // namespace
}  // namespace wavecomb
