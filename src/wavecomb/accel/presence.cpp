// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/accel/presence.h"

#include <algorithm>

#include "wavecomb/core/hash.h"
#include "wavecomb/scene/graph_value.h"
#include "wavecomb/texture/lookup.h"

namespace wavecomb {
namespace {

/// Texture coordinates of a hit on a curve or point; its own where the mesh has none.
Vec2<float> curved_uv(const MeshRecord& mesh, uint32_t prim, float u, float v) {
  const float along = std::min(std::max(u, 0.f), 1.f);
  if ((mesh.flags & kUvsPerCorner) == 0) return {along, v};
  const auto* uvs = reinterpret_cast<const float*>(mesh.uvs);
  if ((mesh.flags & kIsSphere) != 0) return {uvs[2 * prim], uvs[2 * prim + 1]};
  const float* end = uvs + 4 * size_t{prim};
  return {fma(end[2] - end[0], along, end[0]), fma(end[3] - end[1], along, end[1])};
}

/// Texture coordinates of a hit; barycentrics where the mesh has none.
Vec2<float> hit_uv(const MeshRecord& mesh, uint32_t prim, float u, float v) {
  if ((mesh.flags & kIsCurved) != 0) return curved_uv(mesh, prim, u, v);
  if ((mesh.flags & (kUvsPerVertex | kUvsPerCorner)) == 0) return {u, v};
  const auto* indices = reinterpret_cast<const uint32_t*>(mesh.indices);
  const auto* uvs = reinterpret_cast<const float*>(mesh.uvs);
  const float weight[3] = {1.f - u - v, u, v};
  Vec2<float> uv{0, 0};
  for (uint32_t k = 0; k < 3; ++k) {
    const uint32_t at = (mesh.flags & kUvsPerCorner) ? 3 * prim + k : indices[3 * prim + k];
    uv.x += weight[k] * uvs[2 * at];
    uv.y += weight[k] * uvs[2 * at + 1];
  }
  return uv;
}

/// What a graph is given of a hit: on triangles places at rest, and no view.
GraphPoint<float> presence_point(const SceneView& scene, uint32_t instance, uint32_t mesh_id,
                                 uint32_t prim, float u, float v, const Vec2<float>& uv) {
  const MeshRecord& mesh = scene.meshes[mesh_id];
  GraphPoint<float> at;
  at.uv = uv;
  at.place = {mesh_id, prim, u, v};
  if (mesh.indices == 0 || (mesh.flags & kIsCurved) != 0) return at;
  const auto* indices = reinterpret_cast<const uint32_t*>(mesh.indices) + 3 * size_t{prim};
  const auto* positions = reinterpret_cast<const float*>(mesh.positions);
  const auto corner = [&](size_t k) {
    const float* p = positions + 3 * size_t{indices[k]};
    return Vec3<float>(p[0], p[1], p[2]);
  };
  const Vec3<float> p0 = corner(0), e1 = corner(1) - p0, e2 = corner(2) - p0;
  at.local_position = fma(e2, v, fma(e1, u, p0));
  const Vec3<float> n = cross(e1, e2);
  const float length_n = length(n);
  if (length_n > 0) at.local_normal = n * (1.f / length_n);
  const float* m = scene.instances[instance].to_world;
  const auto place = [&](const Vec3<float>& p, float w) {
    const auto row = [&](size_t i) {
      return m[4 * i] * p.x + m[4 * i + 1] * p.y + m[4 * i + 2] * p.z + m[4 * i + 3] * w;
    };
    return Vec3<float>(row(0), row(1), row(2));
  };
  at.position = place(at.local_position, 1.f);
  const Vec3<float> world = cross(place(e1, 0.f), place(e2, 0.f));
  const float length_w = length(world);
  if (length_w > 0) at.normal = world * (scene.instances[instance].side / length_w);
  at.view = at.normal;
  return at;
}

float opacity_at(const SceneView& scene, const MaterialRecord& material, uint32_t material_id,
                 const Vec2<float>& uv, const GraphPoint<float>* point) {
  float opacity = material.opacity;
  if (point)
    opacity = graph_value<float>(scene.materials, material.opacity_graph, kOpacityOutput, *point,
                                 true, Vec3<float>(opacity))
                  .x;
  if (material.texture_slots & slot_bit(Slot::kOpacity)) {
    const TextureUseRecord& use =
        scene.materials.uses[material_id * kSlotCount + static_cast<uint32_t>(Slot::kOpacity)];
    const float s = use.uv[0] * uv.x + use.uv[1] * uv.y + use.uv[2];
    const float t = use.uv[3] * uv.x + use.uv[4] * uv.y + use.uv[5];
    const Texel<float> texel =
        lookup<float>(scene.materials.textures[use.texture], s, t, 0.f, true);
    const float rgba[4] = {texel.r, texel.g, texel.b, texel.a};
    const uint32_t c = use.channel < 4 ? use.channel : 0;
    opacity = rgba[c] * use.scale[c] + use.bias[c];
  }
  if (material.opacity_threshold > 0) return opacity < material.opacity_threshold ? 0.f : 1.f;
  return opacity;
}

}  // namespace

bool casts_shadow(const SceneView& scene, uint32_t instance, uint32_t geom, uint32_t slot,
                  const PresenceKeys& keys) {
  const uint32_t set = keys.shadow_set[size_t{slot} * keys.shadow_stride];
  if (set == 0) return true;
  const LinkView& links = scene.lights.links;
  const uint32_t link = links.classes[scene.instances[instance].emissive + geom];
  return (links.members[(link - 1) * links.words + (set - 1) / 32] >> ((set - 1) % 32) & 1) != 0;
}

bool is_present(const SceneView& scene, uint32_t instance, uint32_t mesh, uint32_t prim, float u,
                float v, uint32_t slot, const PresenceKeys& keys) {
  const MeshRecord& record = scene.meshes[mesh];
  uint32_t material = record.material;
  if (record.face_materials != 0)
    material = reinterpret_cast<const uint32_t*>(record.face_materials)[prim];
  if (material == kInheritMaterial) material = scene.instances[instance].material;
  const MaterialRecord& m = scene.materials.materials[material];
  if ((m.flags & kPresence) == 0) return true;

  const Vec2<float> uv = hit_uv(record, prim, u, v);
  GraphPoint<float> point;
  if (m.opacity_graph != kNoGraph) point = presence_point(scene, instance, mesh, prim, u, v, uv);
  const float opacity =
      opacity_at(scene, m, material, uv, m.opacity_graph != kNoGraph ? &point : nullptr);
  if (opacity >= 1.f) return true;
  if (!(opacity > 0.f)) return false;
  const uint32_t path =
      hash_u32(keys.pixel_hash[slot * keys.stride], keys.sample[slot * keys.stride]);
  const uint32_t where = hash_u32(instance * 0x9e3779b9u + mesh, prim);
  return unit_float<float>(hash_u32(hash_u32(path, keys.salt), where)) < opacity;
}

}  // namespace wavecomb
