// SPDX-License-Identifier: Apache-2.0
/// SceneBuilder::make_lights: the lights of a scene, emissive meshes among them.
#include <algorithm>
#include <cmath>

#include "wavecomb/scene/scene.h"

namespace wavecomb {
namespace {

uint32_t material_of(const Mesh& mesh, const InstanceRecord& instance, size_t face) {
  const uint32_t m = mesh.face_materials.empty() ? mesh.material : mesh.face_materials[face];
  return m == kInheritMaterial ? instance.material : m;
}

/// A mesh of an instance with faces that emit.
struct EmissiveMesh {
  size_t first;  ///< light of its first triangle, counted over all emissive meshes
  const Mesh* mesh;
  const InstanceRecord* instance;
  const Affine* to_world;
};

/// Face `face` of an emissive mesh as a light; radiance 0 where it does not emit.
EmissiveTriangle emissive_triangle(const Scene& scene, const EmissiveMesh& source, size_t face) {
  const Mesh& mesh = *source.mesh;
  const uint32_t material = material_of(mesh, *source.instance, face);
  EmissiveTriangle t{};
  const Material& m = scene.materials()[material];
  Vec3<float> radiance = m.emission;
  if (m.has_texture(Slot::kEmission)) {
    const TextureUse& use = m.textures[static_cast<size_t>(Slot::kEmission)];
    const float* mean = scene.textures()[use.texture]->mean();
    const auto value = [&](uint32_t c) {
      const uint32_t from = use.channel == 4 ? c : use.channel;
      return std::max(0.f, mean[from] * use.scale[from] + use.bias[from]);
    };
    radiance = {value(0), value(1), value(2)};
    t.material = material;
  }
  if (!m.emits()) radiance = {0, 0, 0};
  t.radiance[0] = radiance.x;
  t.radiance[1] = radiance.y;
  t.radiance[2] = radiance.z;
  float* const corners[3] = {t.p0, t.p1, t.p2};
  float* const uvs[3] = {t.uv0, t.uv1, t.uv2};
  constexpr float kBarycentric[3][2] = {{0, 0}, {1, 0}, {0, 1}};
  for (size_t k = 0; k < 3; ++k) {
    const size_t vertex = mesh.indices[3 * face + k];
    const float* p = &mesh.positions[3 * vertex];
    const Vec3<float> w = source.to_world->point({p[0], p[1], p[2]});
    corners[k][0] = w.x;
    corners[k][1] = w.y;
    corners[k][2] = w.z;
    const size_t at = mesh.uvs_at == Attribute::kCorner ? 3 * face + k : vertex;
    const float* uv = mesh.uvs_at == Attribute::kNone ? kBarycentric[k] : &mesh.uvs[2 * at];
    uvs[k][0] = uv[0];
    uvs[k][1] = uv[1];
  }
  return t;
}

}  // namespace

void SceneBuilder::make_lights(Scene& scene) const {
  // Triangles of meshes whose material emits become lights of their own.
  std::vector<EmissiveMesh> sources;
  size_t triangle_count = 0;
  std::vector<uint32_t>& table = scene.emissive_lights_;
  const auto emits = [&](uint32_t material) { return scene.materials_[material].emits(); };
  const bool any_emissive = std::any_of(scene.materials_.begin(), scene.materials_.end(),
                                        [](const Material& m) { return m.emits(); });
  const Affine identity{};

  for (size_t i = 0; any_emissive && i < scene.instance_records_.size(); ++i) {
    InstanceRecord& record = scene.instance_records_[i];
    const Group& group = scene.groups_[i == 0 ? 0 : scene.instances_[i - 1].group];
    record.emissive = static_cast<uint32_t>(table.size());
    for (uint32_t mesh_id : group.meshes) {
      const Mesh& mesh = scene.meshes_[mesh_id];
      bool emissive = false;
      for (size_t f = 0; f < mesh.triangle_count() && !emissive; ++f) {
        emissive = emits(material_of(mesh, record, f));
        if (mesh.face_materials.empty()) break;
      }
      table.push_back(emissive ? static_cast<uint32_t>(triangle_count) : kNoLight);
      if (!emissive) continue;
      sources.push_back(
          {triangle_count, &mesh, &record, i == 0 ? &identity : &scene.instances_[i - 1].to_world});
      scene.triangle_groups_.push_back({static_cast<uint32_t>(triangle_count), mesh.light_group});
      triangle_count += mesh.triangle_count();
    }
  }
  const auto triangle = [&](size_t i) {
    const auto next = std::upper_bound(sources.begin(), sources.end(), i,
                                       [](size_t n, const EmissiveMesh& m) { return n < m.first; });
    const EmissiveMesh& source = *std::prev(next);
    return emissive_triangle(scene, source, i - source.first);
  };

  const Bounds& b = scene.bounds_;
  Vec3<float> center{0, 0, 0};
  float radius = 1;
  if (!b.empty()) {
    center = (b.lo + b.hi) * 0.5f;
    const Vec3<float> d = b.hi - center;
    radius = std::max(1e-20f, std::sqrt(d.x * d.x + d.y * d.y + d.z * d.z));
  }
  scene.light_set_ =
      build_lights(scene.lights_, triangle_count, triangle, center, radius, scene.textures_);
  // Table entries now point at the first triangle; make them light ids.
  for (uint32_t& entry : table)
    if (entry != kNoLight) entry += scene.light_set_.first_triangle();

  SceneView& v = scene.view_;
  v.meshes = scene.mesh_records_.data();
  v.instances = scene.instance_records_.data();
  v.geometry_mesh = scene.geometry_mesh_.data();
  v.emissive_lights = table.data();
  v.material_program = scene.material_program_.data();
  v.materials.materials = scene.material_records_.data();
  v.materials.uses = scene.use_records_.data();
  v.materials.textures = scene.texture_views_.data();
  v.lights = scene.light_set_.view(v.materials);
  v.scale = radius;
  v.has_emissive_meshes = any_emissive;
  v.has_curves = std::any_of(scene.meshes_.begin(), scene.meshes_.end(),
                             [](const Mesh& mesh) { return mesh.is_curved(); });
  v.has_presence = std::any_of(scene.materials_.begin(), scene.materials_.end(),
                               [](const Material& m) { return m.needs_presence(); });
}

std::vector<uint32_t> Scene::groups_of_lights() const {
  std::vector<uint32_t> groups(light_set_.size());
  for (size_t i = 0; i < lights_.size(); ++i) groups[light_set_.of_input[i]] = lights_[i].group;
  for (size_t run = 0; run < triangle_groups_.size(); ++run) {
    const size_t first = light_set_.first_triangle() + triangle_groups_[run].first;
    const size_t end = run + 1 < triangle_groups_.size()
                           ? light_set_.first_triangle() + triangle_groups_[run + 1].first
                           : groups.size();
    std::fill(groups.begin() + static_cast<std::ptrdiff_t>(first),
              groups.begin() + static_cast<std::ptrdiff_t>(end), triangle_groups_[run].group);
  }
  return groups;
}

}  // namespace wavecomb
