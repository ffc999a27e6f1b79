// SPDX-License-Identifier: Apache-2.0
/// Value graphs of materials: parameters that they drive, lanes with equal and different graphs,
/// and emission. tests/python/test_graph_code.py tests the operations against NumPy.
#include <gtest/gtest.h>

#include <cstring>
#include <random>
#include <vector>

#include "graph_ops.h"
#include "lane_testing.h"
#include "wavecomb/graph/noise.h"
#include "wavecomb/light/description/triangle_means.h"
#include "wavecomb/material/openpbr_params.h"

namespace wavecomb {
namespace {

constexpr uint32_t kAllInputs = (1u << kInputCount) - 1;

constexpr uint16_t kUvInput = static_cast<uint16_t>(GraphInput::kUv);
constexpr uint16_t kFirstConstant = kGraphConstant;

/// Makes a value graph with base_color = (u, v, noise), roughness = u - 4, normal = (u, 0, 1) and
/// film_thickness = 900 u.
Graph first_graph() {
  Graph g;
  g.constants = {4.f, 0.f, 1.f, 900.f};
  g.ops = {op(GraphCode::kInput, 2, 0, {}, 0, kUvInput), op(GraphCode::kNoise2, 1, 2, {0}, 1),
           op(GraphCode::kSubtract, 1, 3, {0, kFirstConstant}),
           op(GraphCode::kMultiply, 1, 4, {0, kFirstConstant + 3}),
           op(GraphCode::kImage, 4, 5, {0}, 1)};
  g.images = {{0, 1.f}};
  g.outputs = {{output("base_color", 0), 0},
               {output("base_color", 1), 1},
               {output("base_color", 2), 2},
               {output("roughness"), 3},
               {output("normal", 0), 0},
               {output("normal", 1), kFirstConstant + 1},
               {output("normal", 2), kFirstConstant + 2},
               {output("metallic"), 6},
               {output("film_thickness"), 4}};
  return g;
}
/// opacity = emission = v.
Graph second_graph() {
  Graph g;
  g.ops = {op(GraphCode::kInput, 2, 0, {}, 0, kUvInput)};
  g.outputs = {{output("opacity"), 1},
               {output("emission", 0), 1},
               {output("emission", 1), 1},
               {output("emission", 2), 1}};
  return g;
}

class GraphTest : public ::testing::Test {
 protected:
  GraphTest() {
    std::mt19937 rng(4);
    std::vector<uint8_t> pixels(16 * 16 * 4);
    for (uint8_t& p : pixels) p = static_cast<uint8_t>(rng());
    TextureDesc desc;
    desc.name = "noise";
    desc.data = pixels.data();
    desc.width = desc.height = 16;
    desc.channels = 4;
    desc.format = TexelFormat::kU8;
    texture_ = std::make_unique<Texture>(desc);
    auto graphs = std::make_shared<GraphSet>();
    for (const Graph& g : {first_graph(), second_graph()}) {
      check_graph(g, "test", 1, kGraphOutputCount);
      graphs->add(g);
    }
    std::vector<Material> materials(4);
    for (Material& m : materials) m.program = ProgramId::kOpenPbr;
    materials[1].graph = 0;
    materials[2].graph = materials[2].opacity_graph = materials[2].emission_graph = 1;
    materials[2].presence = true;
    materials[3].graph = 0;
    materials_ = std::make_unique<SceneMaterials>(std::move(materials), graphs,
                                                  std::span<const TexturePtr>(), kInheritMaterial,
                                                  kInheritMaterial);
    view_.materials = materials_->records.data();
    view_.uses = materials_->uses.data();
    view_.textures = &texture_->view();
    view_.openpbr = materials_->openpbr.data();
    view_.graphs = materials_->graphs->view();
  }

  std::unique_ptr<Texture> texture_;
  std::unique_ptr<SceneMaterials> materials_;
  MaterialView view_;
};

/// Evaluates all parameters of the material at uv.
template <typename F>
std::vector<F> parameters(const MaterialView& view, const UInt<F>& material, const Vec2<F>& uv,
                          const F& width, const Mask<F>& active) {
  const auto point = [&](const Mask<F>&) {
    GraphPoint<F> at;
    at.uv = uv;
    at.footprint = width;
    return at;
  };
  auto p = OpenPbrParams<F>::template fetch<kAllInputs>(view, material, uv, width, point, active);
  std::vector<F> all;
  for (const F* place : parameter_pointers(p)) all.push_back(*place);
  const Color<F> emission = fetch_emission<F>(view, material, uv, width, active);
  all.insert(all.end(), {emission.x, emission.y, emission.z,
                         fetch_opacity<F>(view, material, uv, width, active)});
  return all;
}

TEST_F(GraphTest, DrivesWhatItSays) {
  const float u = 0.375f, v = 0.8125f;
  const auto plain = parameters<float>(view_, 0u, {u, v}, 0.f, true);
  const auto got = parameters<float>(view_, 1u, {u, v}, 0.f, true);
  EXPECT_EQ(got[output("base_color", 0)], u);
  EXPECT_EQ(got[output("base_color", 1)], v);
  const float at[2] = {u, v};
  float noise_value;
  noise::perlin<1, float>(at, &noise_value);
  EXPECT_EQ(got[output("base_color", 2)], std::max(noise_value, 0.f));
  EXPECT_EQ(got[output("roughness")], 0.f);  // below 0
  EXPECT_FLOAT_EQ(got[output("normal", 0)], u / std::sqrt(1 + u * u));
  EXPECT_FLOAT_EQ(got[output("film_thickness")], 900 * u);
  EXPECT_EQ(got[output("metallic")], (lookup<float>(texture_->view(), u, v, 0.f, true).g));
  for (const char* same : {"ior", "clearcoat", "opacity", "coat_ior", "fuzz_weight"})
    EXPECT_EQ(got[output(same)], plain[output(same)]) << same;

  const auto other = parameters<float>(view_, 2u, {u, v}, 0.f, true);
  EXPECT_EQ(other[output("opacity")], 1.f);  // opacity means presence
  EXPECT_EQ(other[output("emission")], v);
  EXPECT_EQ(other[other.size() - 2], v);  // fetch_emission
  EXPECT_EQ(other.back(), v);             // fetch_opacity
  EXPECT_EQ(other[output("base_color")], plain[output("base_color")]);
}

TEST_F(GraphTest, OftenEvaluatedIsTheSame) {
  const auto once = parameters<float>(view_, 1u, {0.3f, 0.6f}, 0.1f, true);
  const auto often = parameters<float>(view_, 3u, {0.3f, 0.6f}, 0.1f, true);
  for (size_t i = 0; i < once.size(); ++i) EXPECT_EQ(once[i], often[i]) << i;
}

TEST_F(GraphTest, UniformAndMixedLanesEqualScalar) {
  lane_testing::for_each_packet([&]<typename F>() {
    constexpr size_t kLanes = kWidth<F>;
    std::mt19937 rng(kLanes);
    std::uniform_real_distribution<float> unit(-2, 2);
    for (int round = 0; round < 200; ++round) {
      uint32_t material[kLanes];
      float u[kLanes], v[kLanes], width[kLanes];
      const uint32_t one = rng() % 4;
      for (size_t i = 0; i < kLanes; ++i) {
        material[i] = round % 2 ? one : rng() % 4;
        u[i] = unit(rng);
        v[i] = unit(rng);
        width[i] = rng() % 2 ? 0.2f : 0.f;
      }
      const uint32_t bits = round % 5 ? rng() | 1u : ~0u;
      const auto wide = parameters<F>(view_, wavecomb::load<UInt<F>>(material),
                                      {wavecomb::load<F>(u), wavecomb::load<F>(v)},
                                      wavecomb::load<F>(width), lane_testing::make_mask<F>(bits));
      for (size_t i = 0; i < kLanes; ++i) {
        if (!(bits >> i & 1)) continue;
        const auto narrow = parameters<float>(view_, material[i], {u[i], v[i]}, width[i], true);
        for (size_t k = 0; k < narrow.size(); ++k)
          ASSERT_EQ(std::bit_cast<uint32_t>(narrow[k]),
                    std::bit_cast<uint32_t>(float{lane(wide[k], i)}))
              << kLanes << " lanes, value " << k << ", material " << material[i];
      }
    }
  });
}

TEST_F(GraphTest, OnlyWhatIsKnownOfATriangleMayDriveLights) {
  GraphSet graphs;
  Material m;
  m.program = ProgramId::kOpenPbr;
  m.emission_graph = 0;
  for (const auto& [input, aimed] : {std::pair{GraphInput::kUv, true},
                                     {GraphInput::kPosition, true},
                                     {GraphInput::kLocalPosition, false},
                                     {GraphInput::kView, false},
                                     {GraphInput::kNormal, false}}) {
    Graph g;
    g.ops = {op(GraphCode::kInput, 1, 0, {}, 0, static_cast<uint16_t>(input))};
    g.outputs = {{output("emission"), 0}};
    graphs = {};
    graphs.add(g);
    EXPECT_EQ(can_aim_at(m, graphs), aimed) << static_cast<int>(input);
  }
}

}  // namespace
}  // namespace wavecomb
