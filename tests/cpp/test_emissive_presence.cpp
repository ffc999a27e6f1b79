// SPDX-License-Identifier: Apache-2.0
// Emissive triangles with partial presence: light samples, ray hits and selection probabilities.
// Tests that compare images are in tests/statistics/test_emissive_presence.py.
#include <functional>

#include "lane_testing.h"
#include "scene_testing.h"
#include "wavecomb/accel/presence.h"
#include "wavecomb/core/warp.h"
#include "wavecomb/light/sampling/light_sample.h"

namespace wavecomb {
namespace {

using namespace scene_testing;

const Vec3<float> kGlow(2, 1, 0.5f);
const Vec3<float> kTint(0.5f, 3, 1);
constexpr uint32_t kTexels = 8;

/// Makes an image of kTexels x kTexels values, equal in all channels.
std::vector<float> image(uint32_t seed) {
  std::mt19937 rng(seed);
  std::vector<float> values(size_t{4} * kTexels * kTexels);
  for (float& x : values) x = static_cast<float>(rng() % 1000) / 999.f;
  return values;
}

GraphOp op(GraphCode code, uint8_t width, uint16_t to, std::initializer_list<uint16_t> from,
           uint16_t number = 0) {
  GraphOp o{};
  o.code = static_cast<uint8_t>(code);
  o.width = width;
  o.to = to;
  std::copy(from.begin(), from.end(), o.from);
  o.number = number;
  return o;
}
/// Makes a value graph that sets each component of `parameter` to the coordinate `axis` of `input`,
/// plus 0.5.
Graph ramp(const char* parameter, uint16_t components, GraphInput input, uint16_t axis) {
  Graph g;
  g.constants = {0.5f};
  const uint8_t width = input == GraphInput::kUv ? 2 : 3;
  g.ops = {op(GraphCode::kInput, width, 0, {}, static_cast<uint16_t>(input)),
           op(GraphCode::kAdd, 1, 3, {axis, kGraphConstant})};
  for (uint16_t i = 0; i < components; ++i)
    g.outputs.push_back({static_cast<uint16_t>(graph_parameter(parameter) + i), 3});
  return g;
}

/// Point on a triangle, computed without the code under test.
struct Place {
  float u, v;
  Vec3<float> local;
};

/// Material of a test, with the expected values.
struct Case {
  std::string name;
  std::function<void(SceneBuilder&, Material&)> set;
  std::function<float(const Scene&, const Place&)> opacity;
  std::function<Vec3<float>(const Scene&, const Place&)> emission = {};
};

void add_image(SceneBuilder& b, Material& m, Input slot, uint32_t seed, uint32_t channel) {
  const std::vector<float> values = image(seed);
  TextureDesc desc{"image", values.data(), kTexels, kTexels, 4, TexelFormat::kF32};
  TextureUse& use = m.textures[static_cast<size_t>(slot)];
  use.texture = b.add_texture(desc);
  use.channel = channel;
}
Texel<float> texel(const Scene& scene, uint32_t texture, const Place& at) {
  return lookup<float>(scene.textures()[texture]->view(), at.u, at.v, 0.f, true);
}

std::vector<Case> cases() {
  const auto constant = [](float opacity, float threshold, float expected) {
    return Case{"opacity " + std::to_string(opacity) + ", threshold " + std::to_string(threshold),
                [=](SceneBuilder&, Material& m) {
                  m.opacity = opacity;
                  m.opacity_threshold = threshold;
                },
                [=](const Scene&, const Place&) { return expected; }};
  };
  std::vector<Case> all = {constant(1, 0, 1),       constant(0.5f, 0, 0.5f), constant(0, 0, 0),
                           constant(0.4f, 0.5f, 0), constant(0.6f, 0.5f, 1), constant(1, 2, 0)};
  all.push_back({"texture",
                 [](SceneBuilder& b, Material& m) {
                   m.opacity = 0;  // has no effect
                   add_image(b, m, Input::kOpacity, 1, 3);
                 },
                 [](const Scene& s, const Place& at) { return texel(s, 0, at).a; }});
  all.push_back({"texture and threshold",
                 [](SceneBuilder& b, Material& m) {
                   m.opacity_threshold = 0.5f;
                   add_image(b, m, Input::kOpacity, 2, 0);
                 },
                 [](const Scene& s, const Place& at) {
                   const float value = texel(s, 0, at).r;
                   if (std::abs(value - 0.5f) < 1e-4f) return -1.f;
                   return value < 0.5f ? 0.f : 1.f;
                 }});
  all.push_back({"emission and opacity by textures",
                 [](SceneBuilder& b, Material& m) {
                   add_image(b, m, Input::kOpacity, 3, 0);
                   add_image(b, m, Input::kEmission, 4, 4);
                 },
                 [](const Scene& s, const Place& at) { return texel(s, 0, at).r; },
                 [](const Scene& s, const Place& at) {
                   const Texel<float> t = texel(s, 1, at);
                   return Vec3<float>(t.r, t.g, t.b);
                 }});
  all.push_back({"emission by a texture, constant opacity",
                 [](SceneBuilder& b, Material& m) {
                   add_image(b, m, Input::kEmission, 5, 4);
                   m.opacity = 0.25f;
                 },
                 [](const Scene&, const Place&) { return 0.25f; },
                 [](const Scene& s, const Place& at) {
                   const Texel<float> t = texel(s, 0, at);
                   return Vec3<float>(t.r, t.g, t.b);
                 }});
  all.push_back({"graph of the place in the instance",
                 [](SceneBuilder& b, Material& m) {
                   m.opacity_graph = b.add_graph(ramp("opacity", 1, GraphInput::kLocalPosition, 1));
                 },
                 [](const Scene&, const Place& at) { return at.local.y + 0.5f; }});
  all.push_back({"a graph takes the place of a texture",
                 [](SceneBuilder& b, Material& m) {
                   add_image(b, m, Input::kOpacity, 6, 0);
                   add_image(b, m, Input::kEmission, 7, 4);
                   m.opacity_graph = b.add_graph(ramp("opacity", 1, GraphInput::kLocalPosition, 0));
                   m.emission_graph = b.add_graph(ramp("emission", 1, GraphInput::kUv, 0));
                 },
                 [](const Scene&, const Place& at) { return at.local.x + 0.5f; },
                 [](const Scene& s, const Place& at) {
                   const Texel<float> t = texel(s, 1, at);
                   return Vec3<float>(at.u + 0.5f, t.g, t.b);  // drives red only
                 }});
  all.push_back({"a graph below a threshold",
                 [](SceneBuilder& b, Material& m) {
                   m.opacity_threshold = 0.25f;
                   m.opacity_graph = b.add_graph(ramp("opacity", 1, GraphInput::kLocalPosition, 0));
                 },
                 [](const Scene&, const Place& at) {
                   const float value = at.local.x + 0.5f;
                   return std::abs(value - 0.25f) < 1e-4f ? -1.f : (value < 0.25f ? 0.f : 1.f);
                 }});
  return all;
}

constexpr int kModes = 4;

void add_triangle(SceneBuilder& b, const Case& one, int mode, const Affine& place,
                  uint32_t index = 0, bool visible = true) {
  Material m = make_material(ProgramId::kEmissive);
  m.name = "/Material" + std::to_string(index);
  m.emission = kGlow;
  m.presence = true;
  one.set(b, m);
  MeshData data;
  data.vertex(-0.5f, -0.5f, 0);
  data.vertex(0.5f, -0.5f, 0);
  data.vertex(-0.5f, 0.5f, 0);
  data.triangle(0, 1, 2);
  data.uvs = {0, 0, 1, 0, 0, 1};
  data.uvs_at = Attribute::kVertex;
  Mesh mesh = make_mesh(std::move(data), b.add_material(m));
  if (mode > 0) {
    Light light;
    light.name = "/Light" + std::to_string(index);
    light.kind = LightKind::kTriangle;
    light.color = kTint;
    light.visible = visible;
    light.sync = static_cast<MaterialSync>(mode - 1);
    mesh.mesh_light = b.add_mesh_light(light);
  }
  const uint32_t group = b.add_group("/Group" + std::to_string(index));
  b.add_to_group(group, b.add_mesh(std::move(mesh)));
  b.add_instance(0, group, place);
}
/// Makes a scene of one emissive triangle with the given material.
std::shared_ptr<const Scene> make_scene(const Case& one, int mode) {
  SceneBuilder b;
  add_triangle(b, one, mode, translate(3, 1, -2) * rotate(1, 30) * scale(2, 1, -1));
  b.set_camera(make_camera({0, 0, 5}, {0, 0, 0}));
  return b.build();
}

TEST(EmissivePresence, LightSamplesBringOpacityTimesEmission) {
  std::mt19937 rng(7);
  std::uniform_real_distribution<float> unit(0, 0.9999f);
  for (const Case& one : cases())
    for (int mode = 0; mode < kModes; ++mode) {
      const std::string what = one.name + ", mode " + std::to_string(mode);
      const auto scene = make_scene(one, mode);
      const LightView lights = scene->view().lights;
      for (int i = 0; i < 200; ++i) {
        const float u = unit(rng), v = unit(rng);
        const Vec2<float> b = square_to_triangle(u, v);
        const Place at{b.x, b.y, {b.x - 0.5f, b.y - 0.5f, 0}};
        const float opacity = one.opacity(*scene, at);
        if (opacity < 0) continue;
        Vec3<float> expected = one.emission ? one.emission(*scene, at) : kGlow;
        if (mode == 1 || mode == 3) expected *= kTint;
        if (mode == 2) expected = kTint;
        expected *= opacity;
        const LightReceiver<float> from(Vec3<float>(unit(rng), unit(rng), unit(rng)));
        const auto s = sample_light<float>(lights, from, 0.f, u, v, true);
        if (max_component(expected) < 1e-4f) {
          ASSERT_LE(max_component(s.weight) * s.pdf, 2e-4f) << what;
          continue;
        }
        ASSERT_TRUE(s.valid) << what;
        ASSERT_NEAR(s.weight.x * s.pdf, expected.x, 1e-4f) << what;
        ASSERT_NEAR(s.weight.y * s.pdf, expected.y, 1e-4f) << what;
        ASSERT_NEAR(s.weight.z * s.pdf, expected.z, 1e-4f) << what;
        // For MIS, the density of a direction does not depend on presence.
        const float t = s.distance;
        const float pdf =
            triangle_light_pdf<float>(lights, lights.first_triangle, from, s.wi, t, true);
        ASSERT_NEAR(pdf, s.pdf, 1e-3f * s.pdf) << what;
      }
    }
}

TEST(EmissivePresence, RaysMeetItAsOftenAsItsOpacitySays) {
  constexpr uint32_t kPaths = 2000;
  std::vector<uint32_t> pixel(kPaths, 5), sample(kPaths);
  for (uint32_t i = 0; i < kPaths; ++i) sample[i] = i;
  const PresenceKeys keys{pixel.data(), sample.data(), 1, 3};
  std::mt19937 rng(8);
  std::uniform_real_distribution<float> unit(0, 1);
  for (const Case& one : cases()) {
    const auto scene = make_scene(one, 0);
    const uint32_t mesh = scene->groups()[1].meshes[0];
    for (int i = 0; i < 12; ++i) {
      const Vec2<float> b = square_to_triangle(unit(rng), unit(rng));
      const Place at{b.x, b.y, {b.x - 0.5f, b.y - 0.5f, 0}};
      const double opacity = double{one.opacity(*scene, at)};
      if (opacity < 0) continue;
      uint32_t met = 0;
      for (uint32_t path = 0; path < kPaths; ++path)
        met += is_present(scene->view(),
                          {.instance = 1,
                           .geom = 0,
                           .mesh = mesh,
                           .prim = 0,
                           .u = at.u,
                           .v = at.v,
                           .slot = path},
                          keys)
                   ? 1
                   : 0;
      // There are 156 comparisons with a tolerance of 4.5 standard errors each.
      const double error = std::sqrt(opacity * (1 - opacity) / kPaths);
      EXPECT_NEAR(static_cast<double>(met) / kPaths, opacity, 4.5 * error + 1e-6) << one.name;
    }
  }
}

TEST(EmissivePresence, PacketsEqualScalar) {
  SceneBuilder b;
  const std::vector<Case> all = cases();
  uint32_t index = 0;
  for (const Case& one : all)
    for (int mode = 0; mode < kModes; ++mode, ++index)
      add_triangle(b, one, mode,
                   translate(static_cast<float>(index % 8), static_cast<float>(index / 8), 0) *
                       rotate(0, 10. * index) * scale(1, 2, index % 2 ? 1.f : -1.f),
                   index);
  b.set_camera(make_camera({0, 0, 5}, {0, 0, 0}));
  const auto scene = b.build();
  for (const bool by_tree : {false, true}) {
    LightView lights = scene->view().lights;
    lights.by_tree = by_tree;
    if (by_tree) lights.tree = scene->light_tree(1).view();
    lane_testing::for_each_packet([&]<typename F>() {
      constexpr size_t kLanes = kWidth<F>;
      std::mt19937 rng(kLanes);
      for (uint32_t round = 0; round < 200; ++round) {
        float x[6][kLanes];
        for (auto& column : x)
          for (float& value : column) value = static_cast<float>(rng() >> 8) * 0x1p-24f;
        const uint32_t bits = round % 4 ? rng() | 1u : ~0u;
        const auto at = [&](size_t c) { return wavecomb::load<F>(x[c]); };
        const LightReceiver<F> from(Vec3<F>(at(0), at(1), at(2)));
        const auto wide =
            sample_light<F>(lights, from, at(3), at(4), at(5), lane_testing::make_mask<F>(bits));
        for (size_t i = 0; i < kLanes; ++i) {
          if (!(bits >> i & 1)) continue;
          const auto narrow = sample_light<float>(
              lights, LightReceiver<float>(Vec3<float>(x[0][i], x[1][i], x[2][i])), x[3][i],
              x[4][i], x[5][i], true);
          const auto same = [](float one, float other) {
            return std::bit_cast<uint32_t>(one) == std::bit_cast<uint32_t>(other);
          };
          ASSERT_TRUE(same(narrow.weight.x, lane(wide.weight.x, i)) &&
                      same(narrow.weight.y, lane(wide.weight.y, i)) &&
                      same(narrow.weight.z, lane(wide.weight.z, i)) &&
                      same(narrow.pdf, lane(wide.pdf, i)) &&
                      same(narrow.distance, lane(wide.distance, i)))
              << kLanes << " lanes, by tree " << by_tree;
        }
      }
    });
  }
}

TEST(EmissivePresence, LightsAreChosenByWhatIsThere) {
  const auto power = [](const Case& one) { return make_scene(one, 0)->light_set().total_power; };
  const std::vector<Case> all = cases();
  const double whole = power(all[0]);
  ASSERT_GT(whole, 0);
  EXPECT_NEAR(power(all[1]), 0.5 * whole, 1e-6 * whole);
  for (const size_t absent : {2u, 3u, 5u}) EXPECT_EQ(power(all[absent]), 0) << all[absent].name;
  EXPECT_EQ(power(all[4]), whole);
  double mean = 0;
  const std::vector<float> values = image(1);
  for (size_t i = 3; i < values.size(); i += 4) mean += double{values[i]} / (kTexels * kTexels);
  EXPECT_NEAR(power(all[6]), mean * whole, 0.01 * whole);
  // Opacity is 1 at one corner and 0 at the other two.
  EXPECT_NEAR(power(all[10]), whole / 3, 0.01 * whole);
}

TEST(EmissivePresence, HiddenMeshLightsShine) {
  const Case absent = cases()[2];
  for (const bool visible : {false, true}) {
    SceneBuilder b;
    add_triangle(b, absent, 3, {}, 0, visible);
    b.set_camera(make_camera({0, 0, 5}, {0, 0, 0}));
    EXPECT_EQ(b.build()->light_set().total_power > 0, !visible);
  }
}

TEST(EmissivePresence, EditsOfOpacityAreEditsOfLights) {
  const std::vector<Case> all = cases();
  for (const int mode : {0, 2}) {
    const auto scene = make_scene(all[0], mode);
    SceneEdit edit;
    Material half = scene->materials()[0];
    half.opacity = 0.5f;
    edit.materials[0] = half;
    const auto edited = scene->edited(edit);
    const TriangleLight& before = scene->light_set().triangles[0];
    const TriangleLight& after = edited->light_set().triangles[0];
    for (int c = 0; c < 3; ++c) EXPECT_EQ(after.radiance[c], 0.5f * before.radiance[c]);
    EXPECT_EQ(edited->edited({.materials = {{0, half}}})->light_part(), edited->light_part());
  }
}

}  // namespace
}  // namespace wavecomb
