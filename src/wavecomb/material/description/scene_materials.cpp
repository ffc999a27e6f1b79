// SPDX-License-Identifier: Apache-2.0
/// SceneMaterials: packs materials.
#include <algorithm>
#include <cmath>

#include "wavecomb/core/denormals.h"
#include "wavecomb/graph/parameters/parameters.h"
#include "wavecomb/material/description/simplified_material.h"
#include "wavecomb/material/description/variants.h"
#include "wavecomb/material/lobes/straight_transmission.h"
#include "wavecomb/scene/scene_parts.h"

namespace wavecomb {
namespace {

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
  for (uint32_t s = 0; s < kInputCount; ++s)
    if (m.has_texture(static_cast<Input>(s))) r.textured_inputs |= 1u << s;
  if (m.specular_workflow) r.flags |= kSpecularWorkflow;
  if (m.needs_presence()) r.flags |= kPresence;
  if (m.transmits_straight()) r.flags |= kTransmitsStraight;
  if (m.conductor_k.x > 0 || m.conductor_k.y > 0 || m.conductor_k.z > 0) r.flags |= kConductorIndex;
  if (m.emits()) r.flags |= kEmits;
  r.program = static_cast<uint32_t>(m.program);
  if (has_trait(m.program, program_trait::kLayered) && m.openpbr.anisotropy != 0)
    r.textured_inputs |= kNeedsTangent;
  r.graph = m.graph;
  r.opacity_graph = m.opacity_graph;
  r.emission_graph = m.emission_graph;
  if (m.graph != kNoGraph) {
    r.flags |= kHasGraph;
    r.textured_inputs |= kReadsGraph;
    if (graphs.drives(m.graph, kNormalOutput)) r.textured_inputs |= kGraphNormal;
  }
  return r;
}

bool wants_tangents(const Material& m, const GraphSet& graphs) {
  constexpr uint32_t kTangents =
      graph_input_bit(GraphInput::kTangent) | graph_input_bit(GraphInput::kBitangent);
  return m.has_texture(Input::kNormal) || graphs.drives(m.graph, kNormalOutput) ||
         graphs.reads(m.graph, kTangents) ||
         (has_trait(m.program, program_trait::kLayered) &&
          (m.openpbr.anisotropy != 0 || graphs.drives(m.graph, graph_parameter("anisotropy"))));
}

ProgramParameterRecord make_specific_record(const Material& m) {
  ProgramParameterRecord r{};
  for (size_t i = 0; i < kMaxProgramParameters; ++i) r.value[i] = m.specific_value(i);
  return r;
}

OpenPbrRecord make_openpbr_record(const OpenPbr& m) {
  OpenPbrRecord r{};
  auto& inputs = static_cast<OpenPbrInputs<float>&>(r);
  inputs = m;
  inputs.rotation = m.rotation - std::floor(m.rotation);
  inputs.transmission_tint = m.transmission_color;
  inputs.extinction = Vec3<float>(0.f);
  const auto bring_to_range = [&] {
    detail::for_each_word<0, float>(inputs, [](auto at, float& value) {
      constexpr uint32_t kAt = kFirstOpenPbrOutput + at;
      value = std::clamp(value, kGraphRanges.low[kAt], kGraphRanges.high[kAt]);
    });
  };
  bring_to_range();
  if (m.transmission_depth > 0) {
    const auto extinction = [&](float& tint) {
      const float sigma = -std::log(std::max(tint, 1e-6f)) / m.transmission_depth;
      tint = 1;
      return sigma;
    };
    inputs.extinction = {extinction(inputs.transmission_tint.x),
                         extinction(inputs.transmission_tint.y),
                         extinction(inputs.transmission_tint.z)};
  }
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

/// Returns whether the inputs on which straight transmission depends are constant.
bool has_constant_transmission(const Material& m) {
  if (m.graph != kNoGraph || m.opacity_graph != kNoGraph) return false;
  for (uint32_t s = 0; s < kInputCount; ++s)
    if ((kStraightInputs >> s & 1u) != 0 && m.has_texture(static_cast<Input>(s))) return false;
  return true;
}

/// Returns whether light may pass straight through a thin wall of OpenPBR. Where the index is below
/// 1, total reflection makes transmission too steep for a table.
bool is_clear_wall(const Material& m) {
  return has_trait(m.program, program_trait::kLayered) && m.openpbr.thin_walled &&
         m.openpbr.transmission_weight > 0 && m.ior >= 1 && !m.needs_presence() &&
         has_constant_transmission(m);
}

/// Tabulates the straight transmission of materials with constant inputs, and marks the thin walls
/// that transmit straight.
void add_straight_tables(SceneMaterials& all) {
  MaterialView view;
  view.materials = all.records.data();
  view.openpbr = all.openpbr.data();
  for (uint32_t m = 0; m < all.shaded.size(); ++m) {
    const Material& material = all.shaded[m];
    StraightTable table;
    if (material.transmits_straight() && has_constant_transmission(material))
      table = preview_surface_table(view, m);
    else if (is_clear_wall(material))
      table = wall_table(view, m, material);
    else
      continue;
    if (std::ranges::none_of(table, [](float passing) { return passing > 0; })) continue;
    all.records[m].flags |= kTransmitsStraight;
    all.has_presence = true;
    all.straight_table.resize(all.shaded.size(), kNoStraightTable);
    all.straight_table[m] = static_cast<uint32_t>(all.straight_tables.size() / kStraightNodes);
    all.straight_tables.insert(all.straight_tables.end(), table.begin(), table.end());
  }
}

}  // namespace

SceneMaterials::SceneMaterials(std::vector<Material> all, std::shared_ptr<const GraphSet> programs_,
                               std::span<const TexturePtr> textures, uint32_t exit_material,
                               bool in_glass_)
    : materials(std::move(all)), graphs(std::move(programs_)), in_glass(in_glass_) {
  // Use the same floating-point mode as kernels, so that results are identical.
  const DenormalsOff denormals_off;
  event_material = add_inside_material(materials, *graphs, in_glass);
  for (const Material& m : materials) shaded.push_back(simplified(m, *graphs, textures));
  const bool has_specific = std::ranges::any_of(
      materials, [](const Material& m) { return info_of(m.program).specific_count() > 0; });
  for (const Material& m : shaded) {
    records.push_back(make_material_record(m, *graphs));
    if (has_specific) own.push_back(make_specific_record(m));
    if (has_trait(m.program, program_trait::kLayered)) {
      records.back().openpbr = static_cast<uint32_t>(openpbr.size());
      openpbr.push_back(make_openpbr_record(m.openpbr));
      const SubsurfaceKind walk =
          exit_material != kInheritMaterial ? subsurface_kind(m, *graphs) : SubsurfaceKind::kNone;
      openpbr.back().subsurface = static_cast<float>(walk);
      if (walk != SubsurfaceKind::kNone) {
        walks.resize(materials.size());
        walks[records.size() - 1] = make_subsurface_medium(m, walk);
      }
    }
    for (const TextureUse& use : m.textures) uses.push_back(make_use_record(use));
    programs.push_back(static_cast<uint32_t>(m.program));
    variants.push_back(cheapest_variant(
        m.program, parts_of(m, *graphs, textures, exit_material != kInheritMaterial)));
    wants_tangents.push_back(wavecomb::wants_tangents(m, *graphs) ? 1 : 0);
    has_presence = has_presence || m.needs_presence() || m.transmits_straight();
    has_emission = has_emission || m.emits();
    has_absorbing_graphs = has_absorbing_graphs || absorbs_by_graph(m, *graphs);
  }
  add_straight_tables(*this);
  if (event_material != kInheritMaterial) nested_media = make_mesh_media(shaded, *graphs, true);
}

std::vector<Material> SceneMaterials::given() const {
  std::vector<Material> some = materials;
  if (event_material != kInheritMaterial) some.pop_back();
  return some;
}

}  // namespace wavecomb
