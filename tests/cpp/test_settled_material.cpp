// SPDX-License-Identifier: Apache-2.0
// Material simplification: constant textures become constants, and features that textures and
// graphs cannot reach are dropped. Simplifying the material does not change the image.
#include "wavecomb/material/description/simplified_material.h"

#include "range_testing.h"

namespace wavecomb {
namespace {

using namespace range_testing;
using namespace wave_testing;

TEST(SettledMaterial, WhatIsTheSameAllOverIsAConstant) {
  const auto textures = make_textures();
  Material m = make_material(ProgramId::kPrincipled);
  at(m, Input::kMetallic) = use(0);
  at(m, Input::kRoughness) = use(1, 0);
  at(m, Input::kClearcoat) = use(2);
  at(m, Input::kClearcoatRoughness) = use(3);                 // below 0 everywhere
  at(m, Input::kOpacity) = use(4);                            // above 1 everywhere
  at(m, Input::kBaseColor) = scaled_use(5, 4, 0.5f, 0.125f);  // fma
  at(m, Input::kSpecularColor) = use(5, 1);                   // green for all
  at(m, Input::kEmission) = scaled_use(5, 4, 1e25f, -1e24f);
  at(m, Input::kNormal) = use(1);
  const Material s = simplified(m, {}, textures);
  EXPECT_EQ(s.metallic, 0.f);
  EXPECT_EQ(s.roughness, 1.f);
  EXPECT_EQ(s.clearcoat_roughness, 0.f);
  EXPECT_EQ(s.opacity, 1.f);
  EXPECT_EQ(s.base_color.x, fma(0.2f, 0.5f, 0.125f));
  EXPECT_EQ(s.base_color.z, fma(0.6f, 0.5f, 0.125f));
  EXPECT_EQ(s.specular_color.x, 0.4f);
  EXPECT_EQ(s.specular_color.z, 0.4f);
  EXPECT_EQ(s.emission.x, 1e18f);
  for (uint32_t i = 0; i < kInputCount; ++i) {
    const auto input = static_cast<Input>(i);
    EXPECT_EQ(s.has_texture(input), input == Input::kClearcoat || input == Input::kNormal)
        << kInputNames[i];
  }
  // An input that keeps its texture also keeps the constant that the texture replaces.
  EXPECT_EQ(s.clearcoat, m.clearcoat);
}

TEST(SettledMaterial, ASingleTexelIsEnoughToStay) {
  const auto textures = make_textures(true);
  Material m = make_material(ProgramId::kPrincipled);
  at(m, Input::kOpacity) = use(6);
  at(m, Input::kMetallic) = use(4);  // NaN counts as 0
  Material s = simplified(m, {}, textures);
  EXPECT_TRUE(s.has_texture(Input::kOpacity) && s.has_texture(Input::kMetallic));
  at(m, Input::kOpacity) = scaled_use(6, 0, 1.f, 1.f);
  s = simplified(m, {}, textures);
  EXPECT_FALSE(s.has_texture(Input::kOpacity));
  EXPECT_EQ(s.opacity, 1.f);
}

TEST(SettledMaterial, GetsTheLesserVariant) {
  const auto textures = make_textures();
  const auto variant = [&](ProgramId program, Input input, const TextureUse& use_,
                           bool image = true) {
    Material m = make_material(program, {0.5f, 0.5f, 0.5f});
    if (image) at(m, Input::kBaseColor) = use(2);
    at(m, input) = use_;
    return variant_of(m, textures);
  };
  constexpr auto kP = ProgramId::kPrincipled, kO = ProgramId::kOpenPbr;
  EXPECT_EQ(variant(kP, Input::kMetallic, use(0)), "textured_gloss");
  EXPECT_EQ(variant(kP, Input::kMetallic, use(3)), "textured_gloss");
  EXPECT_EQ(variant(kP, Input::kMetallic, scaled_use(2, 0, -1, 0)), "textured_gloss");
  EXPECT_EQ(variant(kP, Input::kMetallic, use(2)), "textured_metal");
  EXPECT_EQ(variant(kP, Input::kMetallic, use(0), false), "gloss");
  EXPECT_EQ(variant(kP, Input::kMetallic, use(1), false), "tinted_gloss");
  EXPECT_EQ(variant(kP, Input::kOpacity, use(1)), "textured_gloss");
  EXPECT_EQ(variant(kP, Input::kOpacity, use(4), false), "gloss");
  EXPECT_EQ(variant(kP, Input::kRoughness, use(1), false), "gloss");
  EXPECT_EQ(variant(kP, Input::kClearcoat, use(0)), "textured_gloss");
  EXPECT_EQ(variant(kP, Input::kEmission, use(0)), "textured_gloss");
  EXPECT_EQ(variant(kP, Input::kClearcoat, use(2)), "principled");
  EXPECT_EQ(variant(kP, Input::kEmission, use(2)), "principled");
  EXPECT_EQ(variant(kO, Input::kClearcoat, use(0)), "textured_base");
  EXPECT_EQ(variant(kO, Input::kClearcoat, use(2)), "openpbr");
  EXPECT_EQ(variant(kO, Input::kRoughness, use(1), false), "base");
  EXPECT_EQ(variant(kO, Input::kEmission, use(3), false), "base");
}

TEST(SettledMaterial, OpacityThatIsOneAllOverAsksNoRay) {
  SceneBuilder b;
  const uint32_t one = add_texture(b, 4, 4, 1, std::vector<float>(16, 1.f));
  Material m = make_material(ProgramId::kPrincipled);
  at(m, Input::kOpacity) = use(one);
  m.opacity_threshold = 0.5f;
  b.add_to_group(0, b.add_mesh(make_mesh(sphere(4, true), b.add_material(m))));
  b.add_light(make_light(LightKind::kDome, {1, 1, 1}));
  b.set_camera(make_camera({0, 0, 4}, {0, 0, 0}));
  const ScenePtr scene = b.build();
  EXPECT_FALSE(scene->view().has_presence);
  EXPECT_TRUE(scene->materials()[0].has_texture(Input::kOpacity)) << "edits see what was told";
}

TEST(SettledMaterial, OpacityAndEmissionOfGraphsToo) {
  const auto textures = make_textures();
  const auto with_graph = [&](const char* parameter, uint32_t image) {
    GraphSet graphs;
    graphs.add(image_graph(parameter, image));
    Material m = make_material(ProgramId::kPrincipled);
    m.graph = 0;
    (output(parameter) == kEmissionOutput ? m.emission_graph : m.opacity_graph) = 0;
    m.presence = true;
    at(m, Input::kOpacity) = at(m, Input::kEmission) = use(2);
    if (output(parameter) != kOpacityOutput) at(m, Input::kOpacity) = TextureUse{};
    if (output(parameter) != kEmissionOutput) at(m, Input::kEmission) = TextureUse{};
    return std::pair(simplified(m, graphs, textures), variant_of(m, textures, graphs));
  };
  for (const uint32_t one : {1u, 4u}) {
    const auto [m, variant] = with_graph("opacity", one);
    EXPECT_FALSE(m.needs_presence() || m.has_texture(Input::kOpacity));
    EXPECT_EQ(m.opacity, 1.f);
    EXPECT_EQ(m.graph, 0u) << "shading runs the whole of it";
    EXPECT_EQ(variant, "textured_gloss");
  }
  EXPECT_TRUE(with_graph("opacity", 6).first.needs_presence());
  for (const uint32_t black : {0u, 3u}) {
    const auto [m, variant] = with_graph("emission", black);
    EXPECT_FALSE(m.emits());
    EXPECT_EQ(variant, "textured_gloss");
  }
  const auto [shines, variant] = with_graph("emission", 2);
  EXPECT_TRUE(shines.emits());
  EXPECT_EQ(shines.emission_graph, 0u);
  EXPECT_EQ(variant, "principled");
}

// ---- images -----------------------------------------------------------------------------------

/// A ball of `m` above a floor, under a light and a dome. Textures: 0: constant 0.375; 1: the same
/// except for a texel far from (0, 0); 2: an image; 3: constant 0; 4: 0 except for a distant texel;
/// 5 and 6: as 3 and 4, with value 1.
ScenePtr scene_of(const Material& m, const Graph* graph = nullptr) {
  SceneBuilder b;
  const auto grey = [&](float value, float other) {
    std::vector<float> texels(64 * 64, value);
    texels[40 * 64 + 30] = other;
    add_texture(b, 64, 64, 1, texels);
  };
  grey(0.375f, 0.375f);
  grey(0.375f, 0.9f);
  add_texture(b, 8, 8, 3, random_texels(64 * 3, 0.1f, 0.9f, 1));
  grey(0, 0);
  grey(0, 1);
  grey(1, 1);
  grey(1, 0);
  if (graph) b.add_graph(*graph);
  const uint32_t id = b.add_material(m);
  b.add_to_group(0, b.add_mesh(make_mesh(sphere(8, true), id)));
  b.add_to_group(
      0, b.add_mesh(make_mesh(ground(4, -1), b.add_material(make_material(ProgramId::kDiffuse)))));
  b.add_light(make_light(LightKind::kRect, {30, 28, 25}, translate(0, 5, 4) * rotate(0, -60)));
  b.add_light(make_light(LightKind::kDome, {0.3f, 0.3f, 0.4f}));
  b.set_camera(make_camera({0, 0, 4}, {0, 0, 0}));
  return b.build();
}
void expect_same_images(const ScenePtr& first, const ScenePtr& second, const std::string& what) {
  Settings s;
  s.width = s.height = size_for_build(24, 4);
  s.spp = 4;
  s.max_depth = 4;
  s.policy = "program";
  WaveRun expected(first, {s, kReferenceLanes, 1});
  expected.all(64);
  for (const uint32_t lanes : lane_widths()) {
    WaveRun run(second, {s, lanes, 1});
    run.all(1024);
    expect_same_image(expected.image(), run.image(), what + std::to_string(lanes));
  }
}

void expect_same_images(const Material& a, const Material& b, const std::string& what) {
  expect_same_images(scene_of(a), scene_of(b), what);
}

TextureUse corner_of(uint32_t texture) {
  TextureUse u = use(texture);
  u.uv = {0, 0, 0.1f, 0, 0, 0.1f};
  return u;
}

TEST(SettledMaterial, PicturesAreThoseOfTheTextureAndOfTheConstant) {
  struct Case {
    Input input;
    uint32_t constant, varies;
    float value;
  };
  constexpr Case kCases[] = {
      {Input::kMetallic, 3, 4, 0},
      {Input::kMetallic, 0, 1, 0.375f},
      {Input::kOpacity, 5, 6, 1},
      {Input::kOpacity, 0, 1, 0.375f},
      {Input::kClearcoat, 3, 4, 0},
      {Input::kClearcoat, 5, 6, 1},
      {Input::kRoughness, 5, 6, 1},
      {Input::kRoughness, 0, 1, 0.375f},
      {Input::kClearcoatRoughness, 3, 4, 0},
      {Input::kBaseColor, 0, 1, 0.375f},
  };
  for (const ProgramId program : {ProgramId::kPrincipled, ProgramId::kOpenPbr})
    for (const Case& c : kCases) {
      Material m = make_material(program, {0.7f, 0.5f, 0.4f}, 0.3f);
      if (c.input == Input::kClearcoatRoughness) m.clearcoat = 0.5f;
      // Add a texture on another input, so that all three materials use the same tangent frame.
      at(m, c.input == Input::kBaseColor ? Input::kSpecularColor : Input::kBaseColor) = use(2);
      Material same = m, other = m, constant = m;
      at(same, c.input) = corner_of(c.constant);
      at(other, c.input) = corner_of(c.varies);
      const Vec3<float> value(c.value);
      if (c.input == Input::kMetallic) constant.metallic = c.value;
      if (c.input == Input::kOpacity) constant.opacity = c.value;
      if (c.input == Input::kClearcoat) constant.clearcoat = c.value;
      if (c.input == Input::kRoughness) constant.roughness = c.value;
      if (c.input == Input::kClearcoatRoughness) constant.clearcoat_roughness = c.value;
      if (c.input == Input::kBaseColor) constant.base_color = value;
      const std::string what = std::string(kProgramNames[static_cast<size_t>(program)]) + " " +
                               kInputNames[static_cast<size_t>(c.input)] + " ";
      expect_same_images(other, same, what + "texture, lanes ");
      expect_same_images(constant, same, what + "constant, lanes ");
    }
}

TEST(SettledMaterial, CutOutsThatAreWholeAreNone) {
  Material m = make_material(ProgramId::kPrincipled, {0.7f, 0.5f, 0.4f}, 0.3f);
  at(m, Input::kBaseColor) = use(2);
  Material same = m, other = m;
  for (const float threshold : {0.f, 0.5f}) {
    same.opacity_threshold = other.opacity_threshold = threshold;
    same.presence = other.presence = true;
    at(same, Input::kOpacity) = corner_of(5);
    at(other, Input::kOpacity) = corner_of(6);
    ASSERT_TRUE(scene_of(other)->view().has_presence);
    expect_same_images(other, same, "texture, lanes ");
    expect_same_images(m, same, "constant, lanes ");
  }
}

/// Graphs that read the lower left corner of an image.
TEST(SettledMaterial, PicturesOfGraphsAreTheSame) {
  struct Case {
    const char* parameter;
    uint32_t constant, varies;
    bool presence = false;
  };
  constexpr Case kCases[] = {
      {"metallic", 3, 4},      {"clearcoat", 3, 4},     {"opacity", 5, 6},
      {"opacity", 5, 6, true}, {"opacity", 0, 1, true}, {"transmission_weight", 3, 4},
      {"fuzz_weight", 3, 4},   {"anisotropy", 3, 4},    {"subsurface_weight", 3, 4}};
  for (const ProgramId program : {ProgramId::kPrincipled, ProgramId::kOpenPbr})
    for (const Case& c : kCases) {
      const auto scene = [&](uint32_t image) {
        Graph g = image_graph(c.parameter, image);
        g.ops.back() = op(GraphCode::kImage, 4, 2, {kConstant}, 1);
        g.constants = {0.1f, 0.1f};
        g.images.front().stretch = 0;
        Material m = make_material(program, {0.7f, 0.5f, 0.4f}, 0.3f);
        m.openpbr.thin_walled = true;
        m.graph = 0;
        if (output(c.parameter) == kOpacityOutput) m.opacity_graph = 0;
        m.presence = c.presence;
        at(m, Input::kBaseColor) = use(2);
        return scene_of(m, &g);
      };
      expect_same_images(scene(c.varies), scene(c.constant),
                         std::string(kProgramNames[static_cast<size_t>(program)]) + " " +
                             c.parameter + ", lanes ");
    }
}

}  // namespace
}  // namespace wavecomb
