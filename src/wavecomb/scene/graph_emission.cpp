// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/scene/graph_emission.h"

#include <algorithm>
#include <cmath>

#include "wavecomb/scene/graph_value.h"

namespace wavecomb {

bool can_aim_at(const Material& material, const GraphSet& graphs) {
  if (!material.emits()) return false;
  if (material.emission_graph == kNoGraph) return true;
  constexpr uint32_t kKnown =
      graph_input_bit(GraphInput::kUv) | graph_input_bit(GraphInput::kPosition);
  const GraphProgram& program = graphs.programs[material.emission_graph];
  const auto first = graphs.ops.begin() + program.first_op;
  return std::all_of(first, first + program.op_count, [](const GraphOp& op) {
    return static_cast<GraphCode>(op.code) != GraphCode::kInput || (kKnown >> op.number & 1) != 0;
  });
}

void mean_graph_emission(const SceneGeometry& geometry, const SceneMaterials& materials,
                         uint32_t graph, EmissiveTriangle& t) {
  MaterialView view;
  view.textures = geometry.texture_views.data();
  view.graphs = materials.graphs->view();
  view.graphs.attributes = geometry.attributes();
  // Centres of four triangles of equal area; textures are read about as coarse as these are.
  constexpr float kPoints[4][2] = {
      {1.f / 3, 1.f / 3}, {1.f / 6, 1.f / 6}, {2.f / 3, 1.f / 6}, {1.f / 6, 2.f / 3}};
  const float width =
      0.5f * std::max({std::abs(t.uv1[0] - t.uv0[0]), std::abs(t.uv2[0] - t.uv0[0]),
                       std::abs(t.uv1[1] - t.uv0[1]), std::abs(t.uv2[1] - t.uv0[1])});
  Vec3<float> sum{0, 0, 0};
  for (const auto& [u, v] : kPoints) {
    const auto mixed = [u = u, v = v](float a, float b, float c) {
      return a + (b - a) * u + (c - a) * v;
    };
    GraphPoint<float> at;
    at.uv = {mixed(t.uv0[0], t.uv1[0], t.uv2[0]), mixed(t.uv0[1], t.uv1[1], t.uv2[1])};
    at.uv_width = width;
    at.place = {t.mesh, t.prim, u, v};
    at.position = {mixed(t.p0[0], t.p1[0], t.p2[0]), mixed(t.p0[1], t.p1[1], t.p2[1]),
                   mixed(t.p0[2], t.p1[2], t.p2[2])};
    sum += graph_value<float>(view, graph, kEmissionOutput, at, true, Vec3<float>(0.f));
  }
  const float mean[3] = {sum.x * 0.25f, sum.y * 0.25f, sum.z * 0.25f};
  std::copy(mean, mean + 3, t.radiance);
}

}  // namespace wavecomb
