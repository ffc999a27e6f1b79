// SPDX-License-Identifier: Apache-2.0 Cost per queued hit of evaluating the parameters of program
// "openpbr" from constants, and from a value graph of 20 operations (an image, gradient noise,
// sums, mixes and sines of three components). The hits of a packet have one material or four
// different materials.
#include <random>

#include "scene_testing.h"
#include "wavecomb/graph/parameters/parameters.h"
#include "wavecomb/material/openpbr_params.h"
#include "widths.h"

namespace wavecomb::micro {
namespace {

using namespace scene_testing;

constexpr uint32_t kRecords = 4096;
constexpr uint32_t kMixed = 4;
constexpr uint32_t kAllInputs = (1u << kInputCount) - 1;

Graph twenty(float seed) {
  Graph g;
  g.constants = {seed, 0.5f, 0.25f, 0.75f};
  const auto op = [&](GraphCode code, uint8_t width, uint16_t to,
                      std::initializer_list<uint16_t> from, uint8_t steps, GraphInput input = {}) {
    GraphOp o{};
    o.code = static_cast<uint8_t>(code);
    o.width = width;
    o.steps = steps;
    o.to = to;
    std::copy(from.begin(), from.end(), o.from);
    o.number = code == GraphCode::kInput ? static_cast<uint16_t>(input) : uint16_t{0};
    g.ops.push_back(o);
  };
  constexpr uint16_t kC = kGraphConstant;
  op(GraphCode::kInput, 2, 0, {}, 0, GraphInput::kUv);
  op(GraphCode::kInput, 3, 2, {}, 0, GraphInput::kPosition);
  op(GraphCode::kImage, 4, 5, {0}, 1);
  op(GraphCode::kNoise3, 1, 9, {2}, 1);
  op(GraphCode::kMix, 3, 10, {5, 2, 9}, 3);
  for (uint16_t i = 0; i < 7; ++i) {
    op(GraphCode::kMultiply, 3, 13, {10, static_cast<uint16_t>(kC + i % 4)}, 1);
    op(i % 3 == 0 ? GraphCode::kSin : GraphCode::kAdd, 3, 10, {13, 5}, 3);
  }
  op(GraphCode::kClamp, 3, 13, {10, kC + 2, kC + 3}, 1);
  const auto first = [](const char* name) { return static_cast<uint16_t>(graph_parameter(name)); };
  for (uint16_t i = 0; i < 3; ++i)
    g.outputs.push_back(
        {static_cast<uint16_t>(first("base_color") + i), static_cast<uint16_t>(13 + i)});
  g.outputs.push_back({first("roughness"), 14});
  g.images = {{0, 1.f}};
  return g;
}

enum class Kind { kConstants, kUniform, kMixedLanes };

template <size_t W>
void fetch(benchmark::State& state, Kind kind) {
  using F = Lanes<W>;
  SceneBuilder b;
  add_texture(b, 256, 256, 3, random_texels(256 * 256 * 3, 0.2f, 0.8f, 1));
  for (uint32_t i = 0; i < kMixed; ++i) {
    Material m = make_material(ProgramId::kOpenPbr, {0.6f, 0.5f, 0.4f}, 0.4f);
    if (kind != Kind::kConstants) m.graph = b.add_graph(twenty(0.1f * static_cast<float>(i)));
    b.add_material(m);
  }
  b.add_to_group(0, b.add_mesh(make_mesh(sphere(4, true), 0)));
  b.set_camera(make_camera({0, 0, 4}, {0, 0, 0}));
  const ScenePtr scene = b.build();
  const MaterialView view = scene->view().materials;
  std::mt19937 rng(5);
  std::uniform_real_distribution<float> unit(0, 1);
  std::vector<float> place(5 * kRecords);
  for (float& x : place) x = unit(rng);
  std::vector<uint32_t> material(kRecords, 0);
  if (kind == Kind::kMixedLanes)
    for (uint32_t& m : material) m = rng() % kMixed;
  for (auto _ : state) {
    for (uint32_t i = 0; i < kRecords; i += W) {
      const auto column = [&](uint32_t c) { return load<F>(&place[c * kRecords + i]); };
      const Vec2<F> uv{column(0), column(1)};
      const auto point = [&](const Mask<F>&) {
        GraphPoint<F> at;
        at.uv = uv;
        at.position = {column(2), column(3), column(4)};
        return at;
      };
      const auto p = OpenPbrParams<F>::template fetch<kAllInputs>(view, load<UInt<F>>(&material[i]),
                                                                  uv, F(0.f), point, Mask<F>(true));
      keep(F(p.base_color.x + p.roughness + p.coat_ior));
    }
  }
  count_items(state, "record", kRecords);
}

const bool registered = [] {
  for (const auto& [name, kind] : {std::pair{"constants", Kind::kConstants},
                                   {"uniform", Kind::kUniform},
                                   {"mixed", Kind::kMixedLanes}})
    for_each_width([&]<size_t W>() {
      const std::string label = "graph/" + std::string(name) + lanes_label(W);
      benchmark::RegisterBenchmark(label.c_str(), fetch<W>, kind)->Unit(benchmark::kMicrosecond);
    });
  return true;
}();

}  // namespace
}  // namespace wavecomb::micro
