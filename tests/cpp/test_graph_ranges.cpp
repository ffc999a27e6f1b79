// SPDX-License-Identifier: Apache-2.0
// Tests of the value ranges of graphs, which interval arithmetic computes. Results must stay within
// their range, and material variants must leave out features that the range excludes.
#include "wavecomb/graph/parameters/ranges.h"

#include "range_testing.h"
#include "wavecomb/graph/run.h"

namespace wavecomb {
namespace {

using namespace range_testing;

/// Returns the value range of register 8 after `ops`. The inputs are uv in [0, 1] and the image
/// `image` with values from 2 to 5. The range is clamped to the range of specular_weight, [0, 100].
/// Constants: 0, 1, 2, -3, 0.25.
ValueRange range_after(std::vector<GraphOp> ops, uint32_t image = 2) {
  Graph g;
  g.constants = {0.f, 1.f, 2.f, -3.f, 0.25f};
  g.ops = {op(GraphCode::kInput, 2, 0, {}, 0, static_cast<uint16_t>(GraphInput::kUv)),
           op(GraphCode::kImage, 4, 2, {0}, 1)};
  g.ops.insert(g.ops.end(), ops.begin(), ops.end());
  g.images = {{image, 1.f}};
  g.outputs = {{output("specular_weight"), 8}};
  const auto textures = make_textures();
  check_graph(g, "graph", textures.size(), kGraphOutputCount);
  GraphSet graphs;
  graphs.add(Graph{});
  graphs.add(g);
  const DrivenRanges ranges = driven_ranges(graphs, 1, textures);
  EXPECT_FALSE(ranges[output("metallic")]);
  EXPECT_FALSE(driven_ranges(graphs, kNoGraph, textures)[output("specular_weight")]);
  return ranges[output("specular_weight")].value();
}
void expect_range(const ValueRange& range, float low, float high) {
  EXPECT_NEAR(range.low, low, 1e-5f);
  EXPECT_NEAR(range.high, high, 1e-5f);
  EXPECT_FALSE(range.nan);
}

TEST(GraphRanges, FollowArithmetic) {
  using C = GraphCode;
  constexpr uint16_t k0 = kConstant, k1 = kConstant + 1, k2 = kConstant + 2,
                     kMinus3 = kConstant + 3, kQuarter = kConstant + 4;
  expect_range(range_after({op(C::kCopy, 1, 8, {2})}), 0, 1);
  expect_range(range_after({op(C::kCopy, 1, 8, {5})}), 1, 1);  // alpha
  expect_range(range_after({op(C::kAdd, 1, 8, {2, k2})}), 2, 3);
  expect_range(range_after({op(C::kSubtract, 1, 8, {k2, 2})}), 1, 2);
  expect_range(range_after({op(C::kMultiply, 1, 8, {2, k0})}), 0, 0);
  expect_range(range_after({op(C::kMultiply, 1, 8, {2, kMinus3})}), 0, 0);
  expect_range(range_after({op(C::kMultiply, 1, 6, {2, kMinus3}), op(C::kAdd, 1, 8, {6, k2})}), 0,
               2);
  expect_range(range_after({op(C::kMultiply, 1, 6, {2, kMinus3}), op(C::kAbs, 1, 8, {6})}), 0, 3);
  expect_range(range_after({op(C::kMix, 1, 8, {k1, k2, 2})}), 1, 2);
  expect_range(range_after({op(C::kMix, 1, 8, {2, k2, kQuarter})}), 0.5f - 0.25f, 1.25f + 0.25f);
  expect_range(range_after({op(C::kMin, 1, 8, {2, kQuarter})}), 0, 0.25f);
  expect_range(range_after({op(C::kMax, 1, 8, {2, kQuarter})}), 0.25f, 1);
  expect_range(range_after({op(C::kClamp, 1, 8, {2, kQuarter, k0})}), 0, 0);
  expect_range(range_after({op(C::kLess, 1, 8, {2, kQuarter})}), 0, 1);
  expect_range(range_after({op(C::kLess, 1, 8, {2, k2})}), 1, 1);
  expect_range(range_after({op(C::kLess, 1, 8, {5, k1})}), 0, 0);
  expect_range(range_after({op(C::kLess, 1, 8, {0, k1})}), 0, 1);
  expect_range(range_after({op(C::kDivide, 1, 8, {2, kQuarter})}), 0, 4);
  expect_range(range_after({op(C::kDivide, 1, 8, {k0, kMinus3})}), 0, 0);
  expect_range(range_after({op(C::kDivide, 1, 8, {k1, 2})}), 0, 100);
  expect_range(range_after({op(C::kAdd, 1, 6, {2, kMinus3}), op(C::kSqrt, 1, 8, {6})}), 0, 0);
  expect_range(range_after({op(C::kAdd, 1, 6, {2, k2}), op(C::kSqrt, 1, 8, {6})}), std::sqrt(2.f),
               std::sqrt(3.f));
  // A dot product has a single result and does not write the next register.
  expect_range(range_after({op(C::kDot, 3, 8, {2, k1}, 1)}), 0, 3);
  expect_range(range_after({op(C::kCopy, 1, 8, {5}), op(C::kDot, 3, 7, {2, k0}, 1)}), 1, 1);
  expect_range(range_after({op(C::kSelect, 1, 8, {2, k1, k2})}), 1, 2);
  expect_range(range_after({op(C::kSelect, 1, 8, {5, k1, k2})}), 1, 1);
  expect_range(range_after({op(C::kSelect, 1, 8, {k0, k1, k2})}), 2, 2);
  // Operations without known bounds may return any value, including NaN, which becomes the minimum
  // of the range.
  expect_range(range_after({op(C::kExp, 1, 8, {2})}), 0, 100);
  expect_range(range_after({op(C::kMultiply, 1, 8, {0, k0})}), 0, 100);
  expect_range(range_after({op(C::kMax, 1, 8, {0, k2})}), 2, 100);
  expect_range(range_after({op(C::kMax, 1, 8, {k2, 0})}), 0, 100);
  expect_range(range_after({op(C::kClamp, 1, 8, {1, kQuarter, k2})}), 0.25f, 2);
}

/// Evaluates random graph programs at random points and checks that results stay within their
/// ranges.
TEST(GraphRanges, NoResultLeavesThem) {
  using C = GraphCode;
  constexpr C kCodes[] = {C::kAdd,   C::kSubtract, C::kMultiply, C::kMix, C::kMin,  C::kMax,
                          C::kClamp, C::kSelect,   C::kLess,     C::kAbs, C::kCopy, C::kDivide,
                          C::kSqrt,  C::kLog,      C::kEqual,    C::kDot};
  const auto textures = make_textures(true);
  std::vector<TextureView> views;
  for (const TexturePtr& t : textures) views.push_back(t->view());
  std::mt19937 rng(11);
  std::uniform_real_distribution<float> uniform(-3, 3);
  const auto parameter = output("subsurface_anisotropy");  // [-1, 1]
  for (int round = 0; round < 3000; ++round) {
    Graph g;
    g.constants = {0.f, 1.f, uniform(rng), uniform(rng), 1e20f, -1.f};
    g.ops = {op(C::kInput, 2, 0, {}, 0, static_cast<uint16_t>(GraphInput::kUv)),
             op(C::kImage, 4, 2, {0}, 1, 0), op(C::kImage, 4, 6, {0}, 1, 1)};
    g.images = {{static_cast<uint32_t>(rng() % 7), 1.f}, {static_cast<uint32_t>(rng() % 7), 1.f}};
    uint16_t next = 10;
    for (; next < 16; ++next) {
      const auto any = [&] {
        return static_cast<uint16_t>(rng() % 3 == 0 ? kConstant + rng() % 6
                                                    : 2 + rng() % (next - 2u));
      };
      g.ops.push_back(op(kCodes[rng() % std::size(kCodes)], 1, next, {any(), any(), any()}));
    }
    g.outputs = {{parameter, static_cast<uint16_t>(next - 1)}};
    check_graph(g, "graph", textures.size(), kGraphOutputCount);
    GraphSet graphs;
    graphs.add(g);
    const ValueRange range = driven_ranges(graphs, 0, textures)[parameter].value();
    const GraphView view = graphs.view();
    float registers[kMaxGraphRegisters];
    for (int k = 0; k < 40; ++k) {
      GraphPoint<float> point;
      point.uv = {uniform(rng), uniform(rng)};
      point.footprint = k % 2 == 0 ? 0.f : std::abs(uniform(rng)) * 0.3f;
      run_graph<float>(view, view.programs[0], views.data(), point, true, registers);
      const float value = valid_output<float>(
          parameter, graph_output<float>(view, view.programs[0], view.outputs[0], registers));
      ASSERT_GE(value, range.low) << round;
      ASSERT_LE(value, range.high) << round;
    }
  }
}

TEST(GraphRanges, WhatAGraphCannotGiveIsNoPart) {
  const auto textures = make_textures();
  const auto variant = [&](const char* parameter, uint32_t image) {
    GraphSet graphs;
    graphs.add(image_graph(parameter, image));
    Material m = make_material(ProgramId::kOpenPbr);
    m.graph = 0;
    return variant_of(m, textures, graphs);
  };
  for (const char* parameter : {"clearcoat", "transmission_weight", "fuzz_weight", "film_weight",
                                "anisotropy", "rotation"}) {
    EXPECT_EQ(variant(parameter, 0), "textured_base") << parameter;
    EXPECT_EQ(variant(parameter, 3), "textured_base") << parameter;
    EXPECT_EQ(variant(parameter, 2), "openpbr") << parameter;
  }
}

}  // namespace
}  // namespace wavecomb
