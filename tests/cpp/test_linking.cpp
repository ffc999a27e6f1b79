// SPDX-License-Identifier: Apache-2.0
/// Lights that affect surfaces differently: multipliers, hidden shapes, and light linking.
#include "scene_testing.h"
#include "wavecomb/light/description/linking.h"

namespace wavecomb {
namespace {

using namespace scene_testing;

constexpr double kSigmas = 4.6;

Settings settings(uint32_t spp = 64) {
  Settings s;
  s.width = s.height = 16;
  s.spp = size_for_build(spp, 16);
  s.filter = FilterKind::kBox;
  s.filter_width = 1;
  s.max_depth = 1;
  s.roulette = RouletteKind::kOff;
  s.threads = 2;
  return s;
}

Affine facing_down(float y) {
  return translate(0, y, 0) * rotate(0, -90);
}
Light disk(float y = 1) {
  return make_light(LightKind::kDisk, {3, 3, 3}, facing_down(y));
}
/// Irradiance from the disk light disk() at the point below its centre.
constexpr double kUnderDisk = kPiD * 3 * 0.25 / 1.25;

uint32_t add_mesh(SceneBuilder& b, MeshData data, uint32_t material, const char* name) {
  Mesh mesh = make_mesh(std::move(data), material);
  mesh.name = name;
  return b.add_mesh(std::move(mesh));
}

/// A floor of a given material, seen by a camera at the origin.
struct Stage {
  SceneBuilder b;
  explicit Stage(const Material& material) {
    const uint32_t id = b.add_material(material);
    b.add_to_group(0, add_mesh(b, ground(20), id, "/World/Floor"));
    b.set_camera(make_camera({4, 2, 0.5}, {0, 0, 0}, 1e-3f));
  }
  uint32_t set(std::vector<GeometrySet::Entry> entries) {
    return b.add_geometry_set({std::move(entries)});
  }
};

Material grey() {
  return make_material(ProgramId::kDiffuse, {0.6f, 0.6f, 0.6f});
}

/// Renders a scene with waves and with the reference integrator, and expects equal images.
RenderedImage checked(const ScenePtr& scene, const Settings& s) {
  WavefrontRenderer renderer(scene);
  RenderedImage waves = renderer.render(s);
  Settings scalar = s;
  scalar.integrator = IntegratorKind::kReference;
  expect_same_image(renderer.render(scalar), waves, "waves and reference");
  return waves;
}

void expect_mean(const RenderedImage& image, double expected, const char* what) {
  const Mean m = mean_of(image, 1);
  EXPECT_NEAR(m.mean, expected, kSigmas * m.error + 5e-4 * expected + 1e-9) << what;
}

TEST(Multipliers, ScaleTheDiffuseResponse) {
  for (const float factor : {0.f, 0.25f, 2.f}) {
    Stage stage(grey());
    Light light = disk();
    light.diffuse = factor;
    light.specular = 0.5f;
    stage.b.add_light(light);
    expect_mean(checked(stage.b.build(), settings()),
                0.6 / kPiD * kUnderDisk * static_cast<double>(factor), "diffuse");
  }
}

TEST(Multipliers, PartsAddUpToTheWhole) {
  for (const ProgramId program :
       {ProgramId::kPlastic, ProgramId::kPrincipled, ProgramId::kMetal, ProgramId::kOpenPbr}) {
    Material material = make_material(program, {0.5f, 0.5f, 0.5f}, 0.6f);
    material.clearcoat = 0.5f;
    material.clearcoat_roughness = 0.5f;
    const auto mean = [&](float diffuse, float specular) {
      Stage stage(material);
      Light light = make_light(LightKind::kDisk, {3, 3, 3},
                               translate(-1.5f, 1, 0) * rotate(2, 55) * rotate(0, -90));
      light.diffuse = diffuse;
      light.specular = specular;
      stage.b.add_light(light);
      return mean_of(WavefrontRenderer(stage.b.build()).render(settings(256)), 1);
    };
    const Mean both = mean(1, 1), diffuse = mean(1, 0), specular = mean(0, 1),
               mixed = mean(2, 0.5f);
    const auto name = kProgramNames[static_cast<size_t>(program)];
    EXPECT_NEAR(both.mean, diffuse.mean + specular.mean,
                kSigmas * (both.error + diffuse.error + specular.error))
        << name;
    EXPECT_NEAR(mixed.mean, 2 * diffuse.mean + 0.5 * specular.mean,
                kSigmas * (mixed.error + 2 * diffuse.error + specular.error))
        << name;
    EXPECT_GT(specular.mean, 0.01 * both.mean) << name;
    if (program == ProgramId::kMetal) {
      EXPECT_EQ(diffuse.mean, 0);
    } else {
      EXPECT_GT(diffuse.mean, 0.1 * both.mean) << name;
    }
  }
}

TEST(Multipliers, MirrorsAreSpecularAndCamerasAreNot) {
  Material mirror = make_material(ProgramId::kMetal, {1, 1, 1}, 0);
  mirror.specular_color = {1, 1, 1};
  Stage stage(mirror);
  Light dome = make_light(LightKind::kDome, {2, 2, 2});
  dome.specular = 0.25f;
  stage.b.add_light(dome);
  expect_mean(checked(stage.b.build(), settings(16)), 0.5, "mirrored");
  SceneBuilder b;
  b.add_light(dome);
  b.set_camera(make_camera({4, 2, 0.5}, {0, 0, 0}, 1e-3f));
  expect_mean(checked(b.build(), settings(16)), 2, "seen");
}

TEST(HiddenLights, ShineAndAreNotMet) {
  Stage stage(grey());
  Light light = disk();
  light.visible = false;
  stage.b.add_light(light);
  Light above = disk(1);
  above.to_world = facing_down(1.2f);
  stage.b.add_light(above);
  const double from_above = kPiD * 3 * 0.25 / (1.2 * 1.2 + 0.25);
  expect_mean(checked(stage.b.build(), settings(256)), 0.6 / kPiD * (kUnderDisk + from_above),
              "below two");
  SceneBuilder b;
  b.add_light(light);
  b.set_camera(make_camera({0, -3, 0.01}, {0, 1, 0}, 1e-3f));
  expect_mean(checked(b.build(), settings(16)), 0, "looked at");
}

TEST(LightLinks, LightsShineOnWhatTheyAreLinkedTo) {
  for (const bool linked : {false, true}) {
    Stage stage(grey());
    Light light = disk();
    light.light_link = stage.set({{"/", linked ? PathRule::kExpand : PathRule::kExclude},
                                  {"/World/Ball", PathRule::kExpand}});
    stage.b.add_light(light);
    expect_mean(checked(stage.b.build(), settings()), linked ? 0.6 / kPiD * kUnderDisk : 0,
                linked ? "linked" : "not linked");
  }
}

TEST(LightLinks, MirrorsShowWhatTheyAreLinkedTo) {
  for (const bool linked : {false, true}) {
    Stage stage(make_material(ProgramId::kMetal, {1, 1, 1}, 0));
    Light dome = make_light(LightKind::kDome, {2, 2, 2});
    dome.light_link = stage.set({{"/World", linked ? PathRule::kExpand : PathRule::kExclude}});
    stage.b.add_light(dome);
    expect_mean(checked(stage.b.build(), settings(16)), linked ? 2 : 0, "mirrored");
  }
}

TEST(LightLinks, BothTechniquesKeepTheMean) {
  // A light that is linked to everything through a set contributes like an unlinked one.
  RenderedImage pictures[2];
  for (const bool linked : {false, true}) {
    Stage stage(make_material(ProgramId::kPrincipled, {0.5f, 0.5f, 0.5f}, 0.4f));
    Light light = disk();
    if (linked) light.light_link = stage.set({{"/World", PathRule::kExpand}});
    stage.b.add_light(light);
    pictures[linked] = checked(stage.b.build(), settings());
  }
  expect_same_image(pictures[0], pictures[1], "linked to all");
}

TEST(ShadowLinks, OnlyLinkedGeometryCastsShadows) {
  for (const bool instanced : {false, true})
    for (const bool casts : {false, true}) {
      Stage stage(grey());
      const uint32_t black = stage.b.add_material(make_material(ProgramId::kDiffuse, {0, 0, 0}));
      const uint32_t lid =
          add_mesh(stage.b, ground(3, 0.5f), black, instanced ? "/Lid/Mesh" : "/World/Lid/Mesh");
      if (instanced) {
        const uint32_t group = stage.b.add_group("lid", "/Lid");
        stage.b.add_to_group(group, lid);
        stage.b.add_instance(0, group, Affine{}, kInheritMaterial,
                             stage.b.add_placement_name("/World/Lid", 0));
      } else {
        stage.b.add_to_group(0, lid);
      }
      Light light = disk();
      light.shadow_link =
          stage.set({{"/", PathRule::kExpand},
                     {"/World/Lid", casts ? PathRule::kExpand : PathRule::kExclude}});
      stage.b.add_light(light);
      stage.b.set_camera(make_camera({4, 0.3, 0.5}, {0, 0, 0}, 1e-3f));
      expect_mean(checked(stage.b.build(), settings()), casts ? 0 : 0.6 / kPiD * kUnderDisk,
                  instanced ? "instance" : "mesh");
    }
}

TEST(GeometrySets, NearestRuleDecides) {
  const GeometrySet set{{{"/", PathRule::kExclude},
                         {"/A", PathRule::kExpand},
                         {"/A/B", PathRule::kExclude},
                         {"/A/B/C", PathRule::kExplicit},
                         {"/D", PathRule::kExplicit}}};
  EXPECT_TRUE(set.contains("/A"));
  EXPECT_TRUE(set.contains("/A/X/Y"));
  EXPECT_FALSE(set.contains("/AB"));
  EXPECT_FALSE(set.contains("/A/B"));
  EXPECT_FALSE(set.contains("/A/B/X"));
  EXPECT_TRUE(set.contains("/A/B/C"));
  EXPECT_FALSE(set.contains("/A/B/C/X"));
  EXPECT_TRUE(set.contains("/D"));
  EXPECT_FALSE(set.contains("/D/X"));
  EXPECT_FALSE(set.contains("/E"));
  EXPECT_FALSE(GeometrySet{}.contains("/E"));
}

TEST(GeometrySets, BadOnesAreRefusedByName) {
  SceneBuilder b;
  Light light = disk();
  light.name = "/Lamp";
  light.shadow_link = 0;
  EXPECT_THROW(b.add_light(light), Error);
}

}  // namespace
}  // namespace wavecomb
