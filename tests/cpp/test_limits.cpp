// SPDX-License-Identifier: Apache-2.0
/// Tests of size limits. Scenes at these limits would be too large for a test, so the tests pass
/// only counts.
#include <gtest/gtest.h>

#include <functional>
#include <string>

#include "light_testing.h"
#include "wavecomb/core/error.h"
#include "wavecomb/film/layer_ids.h"
#include "wavecomb/scene/scene_limits.h"
#include "wavecomb/scene/scene_parts.h"
#include "wavecomb/texture/lookup.inl"
#include "wavecomb/texture/pyramid.h"

namespace wavecomb {
namespace {

/// Returns the error message of `f`, or "".
std::string refusal(const std::function<void()>& f) {
  try {
    f();
  } catch (const Error& error) {
    return error.what();
  }
  return "";
}

struct Limit {
  uint64_t SceneCounts::* count;
  uint64_t most;
  const char* words;
};

TEST(Limits, scene_counts_end_where_words_do) {
  // In 32-bit words, the offset of the last record must be below 2^31, and the offset of the last
  // row must be below 2^32.
  const Limit limits[] = {
      {&SceneCounts::meshes, 134217728, "134,217,729 meshes"},
      {&SceneCounts::materials, (1ull << 31) / (kInputCount * 16), "materials"},
      {&SceneCounts::instances, 134217727, "134,217,728 instances"},
      {&SceneCounts::grouped, 2147483648, "2,147,483,649 meshes in groups"},
      {&SceneCounts::instanced_meshes, 2147483648, "2,147,483,649 meshes in instances"},
      {&SceneCounts::placements, 4294967295, "4,294,967,296 instances of groups"},
      {&SceneCounts::steps, 268435456, "268,435,457 transforms"},
      {&SceneCounts::lights, 44739242, "44,739,243 lights"},
      {&SceneCounts::profile_values, 2147483648, "IES"},
      {&SceneCounts::link_words, 2147483648, "light links"},
  };
  for (const Limit& limit : limits) {
    SceneCounts counts;
    counts.*limit.count = limit.most;
    EXPECT_EQ(refusal([&] { check_counts(counts); }), "") << limit.words;
    counts.*limit.count = limit.most + 1;
    const std::string said = refusal([&] { check_counts(counts); });
    EXPECT_NE(said.find(limit.words), std::string::npos) << said;
    EXPECT_NE(said.find(" can be numbered; "), std::string::npos) << said;
    EXPECT_EQ(said.find('\n'), std::string::npos);
    counts.*limit.count = ~uint64_t{0};
    EXPECT_NE(refusal([&] { check_counts(counts); }), "");
  }
}

TEST(Limits, the_last_instance_is_gathered_by_a_signed_index) {
  const uint64_t last = kMaxInstances * (sizeof(InstanceRecord) / 4) + 15;
  EXPECT_EQ(last, 0x7fffffffu);
}

TextureDesc image(uint32_t width, uint32_t height, uint32_t channels, TexelFormat format) {
  TextureDesc desc;
  desc.name = "large.tif";
  desc.width = width;
  desc.height = height;
  desc.channels = channels;
  desc.format = format;
  return desc;
}

std::string layout_refusal(const TextureDesc& desc, TextureView& view) {
  view = {};
  view.format = desc.format;
  view.channels = desc.channels == 1 ? 1 : 4;
  return refusal([&] { lay_out(desc, view); });
}

TEST(Limits, texels_are_numbered_to_the_last) {
  TextureView view;
  // One byte per texel: 5.7 thousand million texels take less than 8 GiB, but exceed 32-bit
  // indices.
  const std::string said = layout_refusal(image(65536, 65536, 1, TexelFormat::kU8), view);
  EXPECT_NE(said.find("'large.tif'"), std::string::npos) << said;
  EXPECT_NE(said.find("hold 5726 million texels; 4294 million is the most"), std::string::npos)
      << said;
  EXPECT_NE(layout_refusal(image(49152, 65536, 1, TexelFormat::kU8), view), "");
  EXPECT_NE(layout_refusal(image(65536, 49152, 1, TexelFormat::kF16), view).find("8 GiB"),
            std::string::npos);

  for (const TexelFormat format : {TexelFormat::kU8, TexelFormat::kF16}) {
    ASSERT_EQ(layout_refusal(image(49136, 65536, 1, format), view), "");
    const TextureLevel& level = view.levels[view.level_count - 1];
    ASSERT_GT(level.offset, 4000000000u);
    EXPECT_LT(level.offset + uint64_t{64} * level.tiles_x, uint64_t{1} << 32);
    for (uint32_t n = 0; n < view.level_count; ++n) {
      const TextureLevel& l = view.levels[n];
      const auto lanes = detail::broadcast_level<float>(l);
      const auto read = detail::gather_level<float>(view, n, true);
      EXPECT_EQ(lanes.offset, l.offset);
      EXPECT_EQ(read.offset, l.offset);
      const uint32_t x = l.width - 1, y = l.height - 1;
      EXPECT_EQ(detail::texel_offset<float>(lanes, x, y), texel_index(l, x, y));
    }
  }
}

TEST(Limits, ids_of_layers_are_whole_numbers_of_a_float) {
  AovSet set{static_cast<uint32_t>(Aov::kInstanceId)};
  EXPECT_EQ(refusal([&] { check_id_layers(set, 1u << 24, 1u << 25); }), "");
  const std::string said = refusal([&] { check_id_layers(set, (1u << 24) + 1, 1); });
  EXPECT_EQ(
      said,
      "AOV instance_id: the scene has 16777217 instances, but a float layer can distinguish only "
      "16777216; remove it, or use crypto_object");
  set.bits = static_cast<uint32_t>(Aov::kMaterialId);
  EXPECT_EQ(refusal([&] { check_id_layers(set, 1u << 25, 1u << 24); }), "");
  EXPECT_NE(refusal([&] { check_id_layers(set, 1, (1u << 24) + 1); }).find("crypto_material"),
            std::string::npos);
  // Cryptomatte layers store index + 1, which a float must represent exactly.
  const float last = static_cast<float>((1u << 24) - 1) + 1.f;
  EXPECT_NE(last, static_cast<float>((1u << 24) - 2) + 1.f);
}

/// Makes 100 triangles, a rect and a dome; a table can select among at most `max_power_lights`.
LightSet many_lights(size_t max_power_lights, float mean_scale = 1) {
  using namespace light_testing;
  std::vector<Light> lights{make_light(LightKind::kRect, translate(3, 3, 3)),
                            make_light(LightKind::kDome)};
  for (Light& light : lights) light.color = light.color * mean_scale;
  const auto triangle = [&](size_t i) {
    const auto x = static_cast<float>(i % 10), y = static_cast<float>(i / 10);
    EmissiveTriangle t = make_triangle({x, y, 0}, {x + 1, y, 0}, {x, y + 1, 0.1f * x});
    for (float& c : t.radiance) c *= mean_scale;
    return t;
  };
  return build_lights({.lights = lights,
                       .triangle_count = 100,
                       .triangle = triangle,
                       .scene_radius = 20.f,
                       .max_power_lights = max_power_lights});
}

TEST(Limits, the_tree_alone_chooses_among_more_lights_than_a_table_can) {
  const LightSet all = many_lights(102), more = many_lights(101);
  EXPECT_EQ(kMaxPowerLights, (1u << 24) - 1);
  LightView by_tree = all.view({}), alone = more.view({});
  for (const auto selection : {LightSelection::kAuto, LightSelection::kTree})
    EXPECT_TRUE(chooses_by_tree(selection, alone));
  EXPECT_FALSE(chooses_by_tree(LightSelection::kPower, by_tree));
  EXPECT_EQ(
      refusal([&] { chooses_by_tree(LightSelection::kPower, alone); }),
      "by power one of 16,777,215 lights can be chosen; the scene has 102 lights and emissive "
      "triangles; choose --light-selection tree");
  // Selection by light tree does not use the power table.
  by_tree.by_tree = alone.by_tree = true;
  const LightReceiver<float> to(Vec3<float>{4, 5, 2});
  for (uint32_t i = 0; i < 1000; ++i) {
    const float u = static_cast<float>(i) * 0x1p-10f;
    const auto a = sample_light<float>(by_tree, to, u, 0.3f, 0.6f, true);
    const auto b = sample_light<float>(alone, to, u, 0.3f, 0.6f, true);
    ASSERT_EQ(a.valid, b.valid);
    ASSERT_EQ(a.pdf, b.pdf);
    ASSERT_EQ(a.wi.x, b.wi.x);
    ASSERT_EQ(a.weight.y, b.weight.y);
    ASSERT_EQ(triangle_light_pdf<float>(by_tree, 2 + i % 100, to, a.wi, 1.f, true),
              triangle_light_pdf<float>(alone, 2 + i % 100, to, a.wi, 1.f, true));
  }
}

TEST(Limits, many_lights_that_are_dark_give_no_sample) {
  const LightSet dark = many_lights(10, 0.f);
  LightView view = dark.view({});
  view.by_tree = chooses_by_tree(LightSelection::kAuto, view);
  EXPECT_TRUE(view.by_tree);
  const LightReceiver<float> to(Vec3<float>{4, 5, 2});
  for (const float u : {0.f, 0.5f, kOneMinusEpsilon})
    EXPECT_FALSE(sample_light<float>(view, to, u, 0.3f, 0.6f, true).valid);
}

TEST(Limits, lights_are_numbered_to_the_last) {
  EXPECT_EQ(uint64_t{kMaxLights} * (sizeof(TriangleLight) / 4), kMaxRowWords);
  EXPECT_EQ(uint64_t{kMaxLights} * (sizeof(LightTreeNode) / 4), kMaxRowWords);
  EXPECT_LT(kMaxLights, kTreeLeaf);
  EXPECT_EQ(refusal([] { check_light_count(kMaxLights); }), "");
  EXPECT_EQ(refusal([] { check_light_count(uint64_t{kMaxLights} + 1); }),
            "the scene has 268,435,457 lights and emissive triangles; 268,435,456 can be numbered; "
            "give meshes that emit fewer triangles or instances");
  // Test that a count above 2^32 is not truncated to 32 bits.
  EXPECT_NE(refusal([] { check_light_count((uint64_t{1} << 32) + 5); }), "");
}

}  // namespace
}  // namespace wavecomb
