// SPDX-License-Identifier: Apache-2.0
/// SceneMaterials: materials as lanes read them.
#include <algorithm>
#include <cmath>

#include "wavecomb/scene/graph_parameters.h"
#include "wavecomb/scene/scene_parts.h"

namespace wavecomb {
namespace {

/// Whether program `graph` drives parameter component `output`.
bool drives(const GraphSet& graphs, uint32_t graph, uint32_t output) {
  const GraphProgram& p = graphs.programs[graph];
  const auto first = graphs.outputs.begin() + p.first_output;
  return std::any_of(first, first + p.output_count,
                     [&](const GraphOutput& o) { return o.parameter == output; });
}

MaterialRecord make_material_record(const Material& m, const GraphSet& graphs) {
  MaterialRecord r{};
  const auto put = [](float* to, const Vec3<float>& v) {
    to[0] = v.x;
    to[1] = v.y;
    to[2] = v.z;
  };
  put(r.base_color, m.base_color);
  put(r.specular_color, m.specular_color);
  put(r.emission, m.emission);
  r.roughness = m.roughness;
  r.metallic = m.metallic;
  r.clearcoat = m.clearcoat;
  r.clearcoat_roughness = m.clearcoat_roughness;
  r.opacity = m.opacity;
  put(r.normal, {0, 0, 1});
  r.ior = m.ior;
  r.opacity_threshold = m.opacity_threshold;
  put(r.conductor_eta, m.conductor_eta);
  put(r.conductor_k, m.conductor_k);
  for (uint32_t s = 0; s < kSlotCount; ++s)
    if (m.has_texture(static_cast<Slot>(s))) r.texture_slots |= 1u << s;
  if (m.specular_workflow) r.flags |= kSpecularWorkflow;
  if (m.needs_presence()) r.flags |= kPresence;
  if (m.conductor_k.x > 0 || m.conductor_k.y > 0 || m.conductor_k.z > 0) r.flags |= kConductorIndex;
  if (m.emits()) r.flags |= kEmits;
  r.flags |= (m.evaluations - 1) << kEvaluationsShift;
  r.program = static_cast<uint32_t>(m.program);
  if (m.program == ProgramId::kOpenPbr && m.openpbr.anisotropy != 0)
    r.texture_slots |= kNeedsTangent;
  r.graph = m.graph;
  r.opacity_graph = m.opacity_graph;
  r.emission_graph = m.emission_graph;
  if (m.graph != kNoGraph) {
    r.flags |= kHasGraph;
    r.texture_slots |= kReadsGraph;
    if (drives(graphs, m.graph, kNormalOutput)) r.texture_slots |= kGraphNormal;
  }
  return r;
}

OpenPbrRecord make_openpbr_record(const OpenPbr& m) {
  OpenPbrRecord r{};
  const auto unit = [](float x) { return std::clamp(x, 0.f, 1.f); };
  const auto put = [&unit](float* to, const Vec3<float>& v) {
    to[0] = unit(v.x);
    to[1] = unit(v.y);
    to[2] = unit(v.z);
  };
  r.diffuse_roughness = unit(m.diffuse_roughness);
  r.specular_weight = std::clamp(m.specular_weight, 0.f, 100.f);
  r.anisotropy = unit(m.anisotropy);
  r.rotation = m.rotation - std::floor(m.rotation);
  r.transmission_weight = unit(m.transmission_weight);
  put(r.transmission_tint, m.transmission_color);
  if (m.transmission_depth > 0)
    for (int c = 0; c < 3; ++c) {
      r.extinction[c] = -std::log(std::max(r.transmission_tint[c], 1e-6f)) / m.transmission_depth;
      r.transmission_tint[c] = 1;
    }
  r.subsurface_weight = unit(m.subsurface_weight);
  put(r.subsurface_color, m.subsurface_color);
  r.subsurface_anisotropy = std::clamp(m.subsurface_anisotropy, -1.f, 1.f);
  r.fuzz_weight = unit(m.fuzz_weight);
  put(r.fuzz_color, m.fuzz_color);
  r.fuzz_roughness = unit(m.fuzz_roughness);
  put(r.coat_color, m.coat_color);
  r.coat_ior = std::clamp(m.coat_ior, 0.1f, 10.f);
  r.coat_darkening = unit(m.coat_darkening);
  r.film_weight = unit(m.film_weight);
  r.film_thickness = std::clamp(m.film_thickness, 0.f, 1e5f);
  r.film_ior = std::clamp(m.film_ior, 1.f, 10.f);
  r.thin_walled = m.thin_walled ? 1.f : 0.f;
  return r;
}

TextureUseRecord make_use_record(const TextureUse& use) {
  TextureUseRecord r{};
  r.texture = use.texture;
  r.channel = use.channel;
  std::copy(use.scale.begin(), use.scale.end(), r.scale);
  std::copy(use.bias.begin(), use.bias.end(), r.bias);
  std::copy(use.uv.begin(), use.uv.end(), r.uv);
  return r;
}

}  // namespace

SceneMaterials::SceneMaterials(std::vector<Material> all, std::shared_ptr<const GraphSet> programs_)
    : materials(std::move(all)), graphs(std::move(programs_)) {
  for (const Material& m : materials) {
    records.push_back(make_material_record(m, *graphs));
    if (m.program == ProgramId::kOpenPbr) {
      records.back().openpbr = static_cast<uint32_t>(openpbr.size());
      openpbr.push_back(make_openpbr_record(m.openpbr));
    }
    for (const TextureUse& use : m.textures) uses.push_back(make_use_record(use));
    programs.push_back(static_cast<uint32_t>(m.program));
    has_presence = has_presence || m.needs_presence();
    has_emission = has_emission || m.emits();
  }
}

}  // namespace wavecomb
