// SPDX-License-Identifier: Apache-2.0
// Selection of program variants for materials; the selection does not change the image.
#include <set>

#include "wave_testing.h"
#include "wavecomb/material/description/variants.h"
#include "wavecomb/render/renderer.h"
#include "wavecomb/render/snapshot.h"
#include "wavecomb/render/statistics/render_statistics.h"
#include "wavecomb/scene/scene.h"

namespace wavecomb {
namespace {

using namespace scene_testing;
using namespace wave_testing;

std::string variant_of(const Material& m, const GraphSet& graphs = {}) {
  return kVariants[cheapest_variant(m.program, parts_of(m, graphs, {}))].name;
}

/// Makes a material of a program, modified by `edit`.
template <typename Edit>
Material edited(ProgramId program, Edit edit) {
  Material m = make_material(program, {0.6f, 0.5f, 0.4f}, 0.4f);
  edit(m);
  return m;
}
template <typename Edit>
std::string principled(Edit edit) {
  return variant_of(edited(ProgramId::kPrincipled, edit));
}
template <typename Edit>
std::string openpbr(Edit edit) {
  return variant_of(edited(ProgramId::kOpenPbr, edit));
}
TextureUse& at(Material& m, Input s) {
  return m.textures[static_cast<size_t>(s)];
}

TEST(Variants, MaterialsGetTheLeastThatShowsAll) {
  EXPECT_EQ(principled([](Material&) {}), "gloss");
  EXPECT_EQ(principled([](Material& m) { at(m, Input::kBaseColor).texture = 0; }),
            "textured_gloss");
  EXPECT_EQ(principled([](Material& m) { at(m, Input::kMetallic).texture = 0; }), "textured_metal");
  EXPECT_EQ(principled([](Material& m) { m.metallic = 0.1f; }), "tinted_gloss");
  EXPECT_EQ(principled([](Material& m) { m.specular_workflow = true; }), "tinted_gloss");
  EXPECT_EQ(principled(
                [](Material& m) { m.specular_workflow = true, at(m, Input::kNormal).texture = 0; }),
            "textured_metal");
  EXPECT_EQ(principled([](Material& m) { m.clearcoat = 0.1f; }), "principled");
  EXPECT_EQ(principled([](Material& m) { at(m, Input::kClearcoat).texture = 0; }), "principled");
  EXPECT_EQ(principled([](Material& m) { m.opacity = 0.9f; }), "principled");
  EXPECT_EQ(principled([](Material& m) { at(m, Input::kOpacity).texture = 0; }), "principled");
  EXPECT_EQ(principled([](Material& m) { m.emission = {0, 0, 1}; }), "principled");
  // Presence is not part of the BSDF, so it does not change the variant.
  EXPECT_EQ(principled([](Material& m) { m.opacity = 0.9f, m.presence = true; }), "gloss");
  EXPECT_EQ(principled([](Material& m) {
              at(m, Input::kOpacity).texture = 0, m.opacity_threshold = 0.5f;
            }),
            "textured_gloss");

  EXPECT_EQ(openpbr([](Material& m) { m.metallic = 0.5f; }), "base");
  EXPECT_EQ(openpbr([](Material& m) { at(m, Input::kNormal).texture = 0; }), "textured_base");
  EXPECT_EQ(openpbr([](Material& m) { m.openpbr.subsurface_weight = 1; }), "base");
  const auto full = [](auto edit) { EXPECT_EQ(openpbr(edit), "openpbr"); };
  full([](Material& m) { m.clearcoat = 0.5f; });
  full([](Material& m) { m.emission = {1, 1, 1}; });
  full([](Material& m) { m.openpbr.transmission_weight = 0.1f; });
  full([](Material& m) { m.openpbr.fuzz_weight = 0.1f; });
  full([](Material& m) { m.openpbr.film_weight = 0.1f; });
  full([](Material& m) { m.openpbr.anisotropy = 0.1f; });
  full([](Material& m) { m.openpbr.rotation = 0.1f; });
  full([](Material& m) { m.openpbr.thin_walled = true, m.openpbr.subsurface_weight = 0.5f; });

  for (uint32_t p = 0; p < kProgramCount; ++p) {
    EXPECT_EQ(cheapest_variant(static_cast<ProgramId>(p), kAllParts), p);
    EXPECT_STREQ(kVariants[p].name, kProgramNames[p]);
  }
}

/// Makes a graph that sets `parameter` to a constant.
GraphSet graph_driving(const char* parameter) {
  GraphSet graphs;
  GraphProgram program{};
  program.output_count = 1;
  graphs.programs.push_back(program);
  graphs.outputs.push_back({static_cast<uint16_t>(graph_parameter(parameter)), 0});
  return graphs;
}

TEST(Variants, WhatAGraphDrivesMayBeAnything) {
  const auto driven = [](ProgramId program, const char* parameter) {
    return variant_of(edited(program, [](Material& m) { m.graph = 0; }), graph_driving(parameter));
  };
  EXPECT_EQ(driven(ProgramId::kOpenPbr, "roughness"), "textured_base");
  for (const char* parameter :
       {"clearcoat", "transmission_weight", "fuzz_weight", "film_weight", "anisotropy", "rotation"})
    EXPECT_EQ(driven(ProgramId::kOpenPbr, parameter), "openpbr") << parameter;
  EXPECT_EQ(driven(ProgramId::kPrincipled, "metallic"), "textured_metal");
}

/// Spheres with all variants, two materials each, in front of a wall.
ScenePtr all_variants() {
  SceneBuilder b;
  const uint32_t image = add_texture(b, 8, 8, 3, random_texels(64 * 3, 0.1f, 0.9f, 1));
  std::vector<uint32_t> ids;
  for (uint32_t v = 0; v < kVariantCount; ++v) {
    if (static_cast<uint32_t>(program_of(v)) >= kSurfaceProgramCount) continue;
    for (const float roughness : {0.f, 0.4f}) {
      Material m = make_material(program_of(v), {0.7f, 0.5f, 0.4f}, roughness);
      const uint32_t parts = kVariants[v].parts;
      if ((parts & kTexturePart) != 0) at(m, Input::kBaseColor) = use(image);
      if ((parts & kMetalPart) != 0) m.metallic = 0.4f;
      if ((parts & kCoatPart) != 0) m.clearcoat = 0.5f;
      if ((parts & kEmissionPart) != 0) m.emission = {0.1f, 0.2f, 0.1f};
      if ((parts & kTransmissionPart) != 0) m.opacity = 0.6f, m.openpbr.transmission_weight = 0.4f;
      ids.push_back(b.add_material(m));
    }
  }
  for (size_t i = 0; i < ids.size(); ++i) {
    MeshData ball = sphere(8, true);
    const float x = static_cast<float>(i % 6) - 2.5f, y = static_cast<float>(i / 6) - 1.5f;
    b.add_to_group(0, b.add_mesh(make_mesh(ball.transform(translate(x, y, 0)), ids[i])));
  }
  b.add_to_group(0, b.add_mesh(make_mesh(box({-4, -4, -3}, {4, 4, -2}), ids.front())));
  b.add_light(make_light(LightKind::kRect, {30, 28, 25}, translate(0, 5, 4) * rotate(0, -60)));
  Light dome = make_light(LightKind::kDome, {0.3f, 0.3f, 0.4f});
  b.add_light(dome);
  b.set_camera(make_camera({0, 0, 7}, {0, 0, 0}));
  return b.build();
}

TEST(Variants, NoVariantShowsInThePicture) {
  const ScenePtr scene = all_variants();
  std::set<uint32_t> there;
  for (size_t m = 0; m < scene->materials().size(); ++m)
    there.insert(scene->view().material_variant[m]);
  EXPECT_EQ(there.size(), kVariantCount - kMediumProgramCount) << "some variant is never chosen";

  Settings s;
  s.width = size_for_build(40, 4);
  s.height = size_for_build(30, 4);
  s.spp = 4;
  s.max_depth = 5;
  s.policy = "program";
  const auto accel = std::make_shared<const EmbreeAccelerator>(scene, 2u);
  WaveRun reference(scene, {s, kReferenceLanes, 1}, accel);
  reference.all(64);
  for (const uint32_t lanes : lane_widths()) {
    WaveRun run(scene, {s, lanes, 1}, accel);
    run.all(4096);
    expect_same_image(reference.image(), run.image(), std::to_string(lanes) + " lanes");
  }
}

/// Light paths and the camera paths combined with them use separate plain kernels.
TEST(Variants, NoneShowsWhereLightIsJoined) {
  WavefrontRenderer renderer(all_variants());
  Settings s;
  s.width = size_for_build(40, 4);
  s.height = size_for_build(30, 4);
  s.spp = 4;
  s.max_depth = 5;
  for (const Transport transport : {Transport::kLight, Transport::kBdpt}) {
    s.transport = transport;
    s.integrator = IntegratorKind::kReference;
    const RenderedImage reference = renderer.render(s);
    s.integrator = IntegratorKind::kWavefront;
    for (const char* policy : {"program", "none"}) {
      s.policy = policy;
      EXPECT_EQ(reference.beauty, renderer.render(s).beauty) << policy;
    }
  }
}

}  // namespace
}  // namespace wavecomb
