// SPDX-License-Identifier: Apache-2.0
/// Tests that samples of every kind of light follow the density that MIS uses when a ray hits the
/// light. The receivers are at several points. With several lights, the selection of the light and
/// the position on the light are tested together.
#include <gtest/gtest.h>

#include <cmath>

#include "light_charts.h"
#include "light_tree_testing.h"
#include "parts.h"

namespace wavecomb {
namespace {

using namespace light_testing;
using chi_square::Battery;

/// Points from which lights are seen. Most lights emit along -z and are at the origin.
struct From {
  const char* name;
  Vec3<float> p;
};
const From kNear{"close by", {0.1f, 0.2f, -0.03f}}, kFront{"in front", {0.3f, -0.2f, -1.f}},
    kSide{"at grazing angles", {4, 1, -0.05f}}, kFar{"from afar", {90, -60, -900}},
    kEdge{"on the line of an edge", {1, 0, -0.4f}}, kBehind{"from behind", {0.1f, 0.1f, 1}};
const From kFlat[] = {kNear, kFront, kSide, kFar, kEdge, kBehind};
void see(Battery& battery, const std::string& name, const Lights& lights,
         std::span<const From> points) {
  for (const From& from : points)
    battery.run(light_case(name + ", " + from.name, lights.view(), from.p));
}
void see(Battery& battery, const std::string& name, const Light& light,
         std::span<const From> points) {
  see(battery, name, Lights({light}), points);
}

TEST(LightSamples, OfRectsAndDisksFollowTheirDensity) {
  Battery battery("rects and disks");
  see(battery, "rect", make_light(LightKind::kRect, scale(2, 3, 1)), kFlat);
  const Affine shear{{{1, 0.6f, 0}, {0, 1, 0}, {0, 0, 1}}, {0.2f, 0, 0}};
  see(battery, "sheared rect", make_light(LightKind::kRect, shear * scale(2, 2, 1)), kFlat);
  see(battery, "narrow rect", make_light(LightKind::kRect, scale(40, 0.01f, 1)), kFlat);
  see(battery, "mirrored disk", make_light(LightKind::kDisk, scale(-3, 1.5f, 1)), kFlat);
  see(battery, "disk", make_light(LightKind::kDisk), kFlat);
  battery.judge();
}

TEST(LightSamples, RectsSeenVeryFlatKeepTheirFarEdge) {
  // The distance to the rect is 60 to 100 times the height of the receiver above its plane. The
  // cosine from which the position of a sample is computed is then within 1e-4 of 1. A simple
  // formula rounded positions to 3e-4 of the width and moved 0.13 % of the samples to the far edge.
  const Lights lights({make_light(LightKind::kRect, scale(2, 3, 1))});
  const chi_square::Case c = light_case("flat", lights.view(), Vec3<float>(4, 1, -0.05f));
  chi_square::Random random(3);
  const size_t samples = 200000;
  size_t at_edge = 0;
  for (size_t i = 0; i < samples; ++i) at_edge += c.draw(random, false).place.x > 0.998;
  double expected = 0;
  for (int i = 0; i < 100; ++i) expected += c.density({0, 0.998 + 0.002 * (i + 0.5) / 100, 0.5});
  expected *= 0.002 / 100;
  const double noise = std::sqrt(expected / static_cast<double>(samples));
  EXPECT_NEAR(static_cast<double>(at_edge) / samples, expected, 4 * noise);
}

TEST(LightSamples, OfSpheresAndCylindersFollowTheirDensity) {
  Battery battery("spheres and cylinders");
  const From round[] = {{"almost touching", {0, 0, -0.5005f}},
                        {"close by", {0.1f, 0.3f, -0.5f}},
                        {"some way off", {0.3f, 0.9f, -1}},
                        {"from afar", {90, -60, -900}},
                        {"from inside", {0.1f, 0.1f, 0.2f}}};
  see(battery, "sphere", make_light(LightKind::kSphere), round);
  Light tube = make_light(LightKind::kCylinder);
  tube.length = 2;
  see(battery, "cylinder", tube, round);
  const From ends[] = {{"from its end", {3, 0.7f, -1}},
                       {"almost along the axis", {5, 0.8f, 0}},
                       {"beside its end", {1, 0, -0.52f}}};
  see(battery, "cylinder", tube, ends);
  const From line[] = {{"along a line of it", {5, 0.51f, 0}}, {"and back", {-5, 0.505f, 0.01f}}};
  see(battery, "cylinder", tube, line);
  tube.length = 40;
  tube.radius = 0.01f;
  see(battery, "thin cylinder", tube, ends);
  Light point = make_light(LightKind::kSphere);
  point.radius = 0;
  see(battery, "point", point, std::span(round).first(3));
  battery.judge();
}

/// Makes an image with positive texels, a few of them bright.
std::vector<float> sky(uint32_t width, uint32_t height, float sun) {
  std::vector<float> rgb;
  Numbers number(9);
  for (uint32_t i = 0; i < width * height; ++i) {
    const bool bright = i % 37 == width / 2 % 37;
    for (int c = 0; c < 3; ++c) rgb.push_back(bright ? sun : number());
  }
  return rgb;
}

TEST(LightSamples, OfInfiniteLightsFollowTheirDensity) {
  Battery battery("infinite lights");
  const From anywhere[] = {{"anywhere", {0, 0, 0}}};
  for (const float angle : {0.01f, 0.53f, 60.f, 250.f}) {
    Light distant = make_light(LightKind::kDistant, rotate(40, 110));
    distant.angle = angle;
    see(battery, "distant of " + std::to_string(angle), distant, anywhere);
  }
  see(battery, "dome", make_light(LightKind::kDome), anywhere);
  // The room is at z < 1. One portal is in front of the room, and one is at its side.
  const From rooms[] = {{"in the room", {0, 0, 0}},
                        {"at the window", {0.3f, 0.1f, 0.96f}},
                        {"beside the window", {3, 0.1f, 0.8f}},
                        {"deep in the room", {0, 0, -12}},
                        {"outside", {0.2f, 0, 3}}};
  const std::vector<Affine> portals = {translate(0.2f, 0.1f, 1) * scale(1.5f, 2, 1),
                                       rotate(20, 90) * translate(0, 0, 0.9f) * scale(1, 2, 1)};
  Light lit_room = make_light(LightKind::kDome);
  lit_room.portals = portals;
  see(battery, "dome with portals", lit_room, rooms);
  struct Image {
    uint32_t width, height;
    float sun;
    Wrap wrap;
  };
  for (const Image& image :
       {Image{16, 8, 8, Wrap::kClamp}, {5, 8, 2, Wrap::kRepeat}, {64, 32, 3000, Wrap::kClamp}})
    for (const bool has_portals : {false, true}) {
      Lights lights;
      Light dome = make_light(LightKind::kDome, rotate(20, 35));
      dome.texture = lights.add_texture(image.width, image.height,
                                        sky(image.width, image.height, image.sun), image.wrap);
      if (has_portals) dome.portals = portals;
      lights.build({dome});
      const std::string name = "dome with an image " + std::to_string(image.width) + " wide";
      see(battery, has_portals ? name + " and portals" : name, lights,
          has_portals ? std::span<const From>(rooms) : std::span<const From>(anywhere));
    }
  battery.judge();
}

/// Two IES profiles: one covers a hemisphere, and one is asymmetric.
std::vector<IesProfile> profiles() {
  return {{{0, 40, 40, 90}, {0}, {1, 3, 0.5f, 2}},
          {{0, 90, 180}, {0, 100, 360}, {1, 2, 3, 3, 0, 1, 1, 2, 3}}};
}

TEST(LightSamples, OfTrianglesFollowTheirDensity) {
  Battery battery("triangles");
  const EmissiveTriangle wide = make_triangle({-1, -0.5f, 0}, {1.2f, 0.3f, 0.1f}, {-0.2f, 1.5f, 0}),
                         sliver = make_triangle({-3, 0, 0}, {4, 0.01f, 0}, {4, 0, 0});
  see(battery, "triangle", Lights({}, {wide}), kFlat);
  see(battery, "sliver", Lights({}, {sliver}), kFlat);
  // Several textured, partly transparent triangles.
  Lights textured;
  const uint32_t material = textured.add_material(textured.add_texture(8, 8, sky(8, 8, 20)));
  EmissiveTriangle shown = wide;
  shown.material = material;
  shown.opacity = 0.5f;
  EmissiveTriangle other = make_triangle({2, 0, -0.5f}, {2, 1, -0.5f}, {2, 0, -1.5f});
  other.opacity = 0.25f;
  textured.build({}, {shown, other, sliver});
  see(battery, "textured triangles", textured, kFlat);
  // A mesh light with shaping.
  Light lamp = make_light(LightKind::kTriangle);
  lamp.shaping.focus = 2;
  lamp.shaping.focus_tint = {0.2f, 0.1f, 0.3f};
  const MeshLightInstance placed{&lamp, rotate(30, 0), 2, true};
  std::vector<EmissiveTriangle> mesh = {wide, other};
  for (EmissiveTriangle& t : mesh) t.mesh_light = 0;
  Lights lit;
  lit.set = build_lights({.triangle_count = mesh.size(),
                          .triangle = [&](size_t i) { return mesh[i]; },
                          .scene_radius = 10,
                          .textures = lit.textures,
                          .mesh_lights = {&placed, 1}});
  see(battery, "mesh light", lit, kFlat);
  battery.judge();
}

TEST(LightSamples, OfShapedLightsFollowTheirDensity) {
  Battery battery("shaped lights");
  Light light = make_light(LightKind::kSphere);
  light.shaping.cone_angle = 70;
  light.shaping.cone_softness = 0.5f;
  const From points[] = {{"within the cone", {0.1f, 0.2f, -1.5f}},
                         {"at its edge", {1.6f, 0.2f, -0.8f}},
                         {"close by", {0.1f, 0.45f, -0.3f}}};
  see(battery, "sphere with a cone", light, points);
  light.radius = 0;
  see(battery, "point with a cone", light, points);
  light = make_light(LightKind::kRect, scale(2, 3, 1));
  light.shaping.focus = 3;
  light.shaping.cone_angle = 60;
  see(battery, "rect with a cone", light, points);
  for (uint32_t profile = 0; profile < 2; ++profile)
    for (const LightKind kind : {LightKind::kDisk, LightKind::kSphere, LightKind::kCylinder}) {
      Lights lights;
      lights.profiles = profiles();
      Light lamp = make_light(kind);
      lamp.shaping.ies = profile;
      lights.build({lamp});
      see(battery, "IES profile " + std::to_string(profile), lights, points);
    }
  battery.judge();
}

TEST(LightSamples, OfManyLightsFollowTheirDensity) {
  // Tests the selection of a light together with the position on it, by power and by light tree.
  Battery battery("many lights");
  const Lights lights = random_lights(is_long() ? 60 : 20, 7, 3);
  Numbers number(21);
  for (int k = 0; k < (is_long() ? 8 : 3); ++k) {
    const LightReceiver<float> to = random_receiver(number);
    battery.run(light_case("by power, " + std::to_string(k), lights.view(), to));
    battery.run(light_case("by tree, " + std::to_string(k), by_tree(lights), to));
  }
  battery.judge();
}

}  // namespace
}  // namespace wavecomb
