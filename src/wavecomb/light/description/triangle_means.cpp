// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/light/description/triangle_means.h"

#include <algorithm>
#include <cmath>

#include "wavecomb/graph/parameters/value.h"

namespace wavecomb {
namespace {

/// Lower limit of the estimated mean opacity of a triangle whose opacity varies. Light sampling
/// would ignore triangles with an estimate of 0.
constexpr float kMinOpacity = 1.f / 16;

/// Returns the mean value of a textured material input over the whole texture.
Vec3<float> mean_texture(const SceneGeometry& geometry, const TextureUse& use) {
  const float* mean = geometry.textures[use.texture]->mean();
  const auto value = [&](uint32_t c) {
    const uint32_t from = use.channel == 4 ? c : use.channel;
    return std::max(0.f, mean[from] * use.scale[from] + use.bias[from]);
  };
  return {value(0), value(1), value(2)};
}

/// Returns the mean of f(x) over a few points of a triangle, where x holds three outputs of
/// `graph`, starting at component `output`.
template <typename Function>
Vec3<float> mean_graph(const SceneGeometry& geometry, const SceneMaterials& materials,
                       uint32_t graph, uint32_t output, const Vec3<float>& plain,
                       const EmissiveTriangle& t, const Function& f) {
  MaterialView view;
  view.textures = geometry.texture_views.data();
  view.graphs = materials.graphs->view();
  view.graphs.attributes = geometry.attributes();
  const Mesh& mesh = geometry.meshes[t.mesh];
  const auto local = [&](size_t k) {
    const float* p = &mesh.positions[size_t{3} * mesh.indices[size_t{3} * t.prim + k]];
    return Vec3<float>(p[0], p[1], p[2]);
  };
  // Evaluate the graph at the centres of four sub-triangles of equal area, with texture footprints
  // of about the size of a sub-triangle.
  constexpr float kPoints[4][2] = {
      {1.f / 3, 1.f / 3}, {1.f / 6, 1.f / 6}, {2.f / 3, 1.f / 6}, {1.f / 6, 2.f / 3}};
  const float width =
      0.5f * std::max({std::abs(t.uv1[0] - t.uv0[0]), std::abs(t.uv2[0] - t.uv0[0]),
                       std::abs(t.uv1[1] - t.uv0[1]), std::abs(t.uv2[1] - t.uv0[1])});
  Vec3<float> sum{0, 0, 0};
  for (const auto& [u, v] : kPoints) {
    const auto mixed = [u = u, v = v](const auto& a, const auto& b, const auto& c) {
      return a + (b - a) * u + (c - a) * v;
    };
    GraphPoint<float> at;
    at.uv = {mixed(t.uv0[0], t.uv1[0], t.uv2[0]), mixed(t.uv0[1], t.uv1[1], t.uv2[1])};
    at.footprint = width;
    at.mesh_position = {t.mesh, t.prim, u, v};
    at.position = {mixed(t.p0[0], t.p1[0], t.p2[0]), mixed(t.p0[1], t.p1[1], t.p2[1]),
                   mixed(t.p0[2], t.p1[2], t.p2[2])};
    at.local_position = mixed(local(0), local(1), local(2));
    sum += f(graph_value<float>(view, graph, output, at, true, plain));
  }
  return sum * 0.25f;
}

}  // namespace

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

void set_mean_emission(const SceneGeometry& geometry, const SceneMaterials& materials,
                       const Material& material, EmissiveTriangle& t) {
  Vec3<float> radiance{0, 0, 0};
  if (can_aim_at(material, *materials.graphs)) {
    radiance = material.emission;
    if (material.has_texture(Input::kEmission))
      radiance = mean_texture(geometry, material.textures[static_cast<size_t>(Input::kEmission)]);
    if (material.emission_graph != kNoGraph)
      radiance = mean_graph(geometry, materials, material.emission_graph, kEmissionOutput, radiance,
                            t, [](const Vec3<float>& value) { return value; });
  }
  t.radiance[0] = radiance.x;
  t.radiance[1] = radiance.y;
  t.radiance[2] = radiance.z;
}

void set_mean_opacity(const SceneGeometry& geometry, const SceneMaterials& materials,
                      const Material& material, EmissiveTriangle& t) {
  t.opacity = 1;
  t.opacity_varies = material.needs_presence() && material.opacity_varies();
  if (!material.needs_presence()) return;
  const float threshold = material.opacity_threshold;
  const auto presence_of = [threshold](float opacity) {
    return threshold > 0 ? (opacity < threshold ? 0.f : 1.f) : opacity;
  };
  const auto unit = [](float x) { return std::clamp(x, 0.f, 1.f); };
  float opacity = unit(material.opacity);
  // With a threshold, opacity is 0 or 1 nearly everywhere, so the mean of the texture estimates the
  // covered fraction.
  if (material.has_texture(Input::kOpacity))
    opacity =
        unit(mean_texture(geometry, material.textures[static_cast<size_t>(Input::kOpacity)]).x);
  if (material.opacity_graph != kNoGraph)
    opacity = mean_graph(
                  geometry, materials, material.opacity_graph, kOpacityOutput, Vec3<float>(opacity),
                  t, [&](const Vec3<float>& value) { return Vec3<float>(presence_of(value.x)); })
                  .x;
  t.opacity = t.opacity_varies ? std::max(opacity, kMinOpacity) : presence_of(opacity);
}

}  // namespace wavecomb
