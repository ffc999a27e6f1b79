// SPDX-License-Identifier: Apache-2.0
/// Tests of the table of light parameters: its rows, and the checks and the fingerprint that the
/// code derives from the table.
#include "wavecomb/light/description/light_table.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <set>
#include <string>

#include "scene_testing.h"
#include "wavecomb/core/error.h"
#include "wavecomb/scene/fingerprint.h"

namespace wavecomb {
namespace {

using scene_testing::make_light;

using scene_testing::kInf;
using scene_testing::kNan;
constexpr LightReferences kThere{2, 2, 2, 2};

Light a_light(LightKind kind = LightKind::kRect) {
  Light light = make_light(kind, {1, 1, 1});
  light.name = "/World/light";
  return light;
}

/// Returns the error message of the checks of a light, or an empty string if the light is valid.
template <typename Change>
std::string said(const Change& change, const LightReferences& there = kThere) {
  Light light = a_light();
  change(light);
  try {
    check_light(light, there);
  } catch (const Error& e) {
    return e.what();
  }
  return "";
}

/// Returns a valid value of a parameter that differs from its default.
LightValue another(const LightParameter& p) {
  switch (p.kind) {
    case LightValueKind::kNumber:
      return static_cast<float>(p.least == 0 ? 0.25 : -0.25);
    case LightValueKind::kColour:
      return Vec3<float>{0.25f, 0.5f, 0.75f};
    case LightValueKind::kFlag:
      return !std::get<bool>(p.standard());
    case LightValueKind::kChoice:
    case LightValueKind::kId:
      return uint32_t{1};
    case LightValueKind::kTransforms:
      break;
  }
  return std::vector<Affine>(2);
}

bool same(const LightValue& a, const LightValue& b) {
  if (a.index() != b.index()) return false;
  if (const auto* c = std::get_if<Vec3<float>>(&a)) {
    const auto& d = std::get<Vec3<float>>(b);
    return c->x == d.x && c->y == d.y && c->z == d.z;
  }
  if (const auto* maps = std::get_if<std::vector<Affine>>(&a))
    return maps->size() == std::get<std::vector<Affine>>(b).size();
  if (const auto* v = std::get_if<float>(&a)) return *v == std::get<float>(b);
  if (const auto* v = std::get_if<bool>(&a)) return *v == std::get<bool>(b);
  if (const auto* v = std::get_if<uint32_t>(&a)) return *v == std::get<uint32_t>(b);
  return true;
}

uint64_t hash_of(const Light& light) {
  SceneBuilder b;
  for (const char* group : {"", "key"}) (void)b.light_group(group);
  for (int i = 0; i < 2; ++i) {
    b.add_texture({"t", "\x10\x20\x30", 1, 1, 3, TexelFormat::kU8, false});
    b.add_ies({{0, 90}, {0}, {1, 1}});
    b.add_geometry_set({{{"/", PathRule::kExpand}}});
    b.add_light_filter({});
  }
  if (light.kind == LightKind::kTriangle)
    b.add_mesh_light(light);
  else
    b.add_light(light);
  for (const auto& [part, hash] : fingerprint(*b.build(), false))
    if (part == "lights") return hash;
  return 0;
}

TEST(LightTable, RowsAreMembersWithNamesOfTheirOwn) {
  std::set<std::string> names;
  for (const LightParameter& p : light_table()) {
    EXPECT_TRUE(names.insert(p.name).second) << p.name;
    EXPECT_EQ(find_light_parameter(p.name), &p);
    EXPECT_NE(p.kinds, 0u) << p.name;
    EXPECT_TRUE(std::string(p.help).ends_with(".")) << p.name;
    Light light = a_light();
    EXPECT_TRUE(same(p.read(light), p.standard()) || p.name == std::string("color")) << p.name;
    p.write(light, another(p));
    EXPECT_TRUE(same(p.read(light), another(p))) << p.name;
    EXPECT_FALSE(same(p.read(light), p.standard())) << p.name;
    p.write(light, p.standard());
    EXPECT_TRUE(same(p.read(light), p.standard())) << p.name;
  }
  EXPECT_EQ(find_light_parameter("teatime"), nullptr);
  for (uint32_t k = 0; k < static_cast<uint32_t>(LightKind::kTriangle); ++k)
    EXPECT_EQ(light_kind(light_kind_name(static_cast<LightKind>(k))), static_cast<LightKind>(k));
  EXPECT_THROW(light_kind("triangle"), Error);
}

TEST(LightTable, EveryRowIsCheckedAndKept) {
  for (const LightKind kind : {LightKind::kRect, LightKind::kTriangle}) {
    const uint64_t plain = hash_of(a_light(kind));
    for (const LightParameter& p : light_table()) {
      if (p.is_specific && !p.is_of(kind)) continue;
      Light light = a_light(kind);
      p.write(light, another(p));
      EXPECT_NE(hash_of(light), plain) << p.name;
    }
  }
  for (const LightParameter& p : light_table()) {
    if (p.is_specific && !p.is_of(LightKind::kRect)) continue;
    const auto message = [&](const LightValue& value, const LightReferences& there = kThere) {
      return said([&](Light& light) { p.write(light, value); }, there);
    };
    EXPECT_EQ(message(another(p)), "") << p.name;
    std::vector<LightValue> bad;
    if (p.kind == LightValueKind::kNumber) bad = {kNan, kInf, -kInf};
    if (p.kind == LightValueKind::kColour)
      bad = {Vec3<float>{kNan, 0, 0}, Vec3<float>{0, kInf, 0}, Vec3<float>{0, 0, -kInf}};
    if (p.kind == LightValueKind::kTransforms)
      bad = {std::vector<Affine>{Affine{}, Affine{{}, {0, kNan, 0}}}};
    if (p.kind == LightValueKind::kNumber && p.least == 0) bad.push_back(-0.5f);
    if (p.refers != LightRefers::kNothing && p.refers != LightRefers::kGroup)
      bad.push_back(uint32_t{2});
    for (const LightValue& value : bad) {
      const std::string m = message(value);
      EXPECT_NE(m.find("light '/World/light': "), std::string::npos) << p.name;
      EXPECT_NE(m.find(p.name), std::string::npos) << m;
      EXPECT_EQ(m.find('\n'), std::string::npos) << m;
    }
  }
}

TEST(LightTable, MessagesSayWhatToDo) {
  EXPECT_EQ(said([](Light& l) { l.radius = -1; }),
            "light '/World/light': radius is -1; it must be 0 or more");
  EXPECT_EQ(said([](Light& l) { l.shaping.focus = kNan; }),
            "light '/World/light': focus is nan; it must be a finite number");
  EXPECT_EQ(said([](Light& l) { l.color = {0, -2, 0}; }),
            "light '/World/light': color is (0, -2, 0); each must be 0 or more");
  EXPECT_EQ(said([](Light& l) { l.texture = 7; }),
            "light '/World/light': texture is texture 7, which was never added; add textures "
            "before lights");
  EXPECT_EQ(said([](Light& l) { l.to_world.t.x = kInf; }),
            "light '/World/light': its transform is not finite; give finite numbers");
  EXPECT_EQ(said([](Light& l) { l.to_world.row[1].z = kNan; }),
            "light '/World/light': its transform is not finite; give finite numbers");
  EXPECT_EQ(said([](Light& l) { l.kind = LightKind::kTriangle; }),
            "light '/World/light': lights of its kind have no transform");
  EXPECT_THROW(check_mesh_light(a_light(), kThere), Error);
}

}  // namespace
}  // namespace wavecomb
