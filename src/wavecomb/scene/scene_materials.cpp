// SPDX-License-Identifier: Apache-2.0
/// SceneMaterials: materials as lanes read them.
#include <algorithm>

#include "wavecomb/scene/scene_parts.h"

namespace wavecomb {
namespace {

MaterialRecord make_material_record(const Material& m) {
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

SceneMaterials::SceneMaterials(std::vector<Material> all) : materials(std::move(all)) {
  for (const Material& m : materials) {
    records.push_back(make_material_record(m));
    for (const TextureUse& use : m.textures) uses.push_back(make_use_record(use));
    programs.push_back(static_cast<uint32_t>(m.program));
    has_presence = has_presence || m.needs_presence();
    has_emission = has_emission || m.emits();
  }
}

}  // namespace wavecomb
