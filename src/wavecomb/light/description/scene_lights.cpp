// SPDX-License-Identifier: Apache-2.0
/// SceneLights: the lights of a scene, including emissive meshes.
#include <algorithm>
#include <cmath>

#include "wavecomb/light/description/triangle_means.h"
#include "wavecomb/scene/parallel.h"
#include "wavecomb/scene/scene.h"

namespace wavecomb {
namespace {

uint32_t material_of(const Mesh& mesh, const InstanceRecord& instance, size_t face) {
  const uint32_t m = mesh.face_materials.empty() ? mesh.material : mesh.face_materials[face];
  return m == kInheritMaterial ? instance.material : m;
}

/// Instance of a mesh with emissive faces.
struct EmissiveMesh {
  size_t first;  ///< index of the mesh's first triangle among the triangles of all emissive meshes
  const Mesh* mesh;
  uint32_t mesh_id, instance_id;
  const InstanceRecord* instance;
  const Affine* to_world;
  uint32_t mesh_light;  ///< index of the mesh's MeshLightInstance, or kNoLight
};

uint64_t bytes_of(const LightTree& tree) {
  return tree.nodes.size() * sizeof(tree.nodes[0]) + tree.trails.size() * sizeof(tree.trails[0]);
}

/// Returns the one-sided world-space area of a mesh at mid-shutter.
double world_area(const Mesh& mesh, const Affine& to_world) {
  const std::span<const float> positions = mesh.positions.subspan(
      mesh.steps / 2 * (mesh.positions.size() / mesh.steps), mesh.positions.size() / mesh.steps);
  double sum = 0;
  for (size_t i = 0; i + 2 < mesh.indices.size(); i += 3) {
    double p[3][3];
    for (size_t k = 0; k < 3; ++k) {
      const float* const at = &positions[size_t{3} * mesh.indices[i + k]];
      const Vec3<float> w = to_world.point({at[0], at[1], at[2]});
      p[k][0] = double{w.x};
      p[k][1] = double{w.y};
      p[k][2] = double{w.z};
    }
    double square = 0;
    for (size_t k = 0; k < 3; ++k) {
      const size_t a = (k + 1) % 3, b = (k + 2) % 3;
      const double c =
          (p[1][a] - p[0][a]) * (p[2][b] - p[0][b]) - (p[1][b] - p[0][b]) * (p[2][a] - p[0][a]);
      square += c * c;
    }
    sum += 0.5 * std::sqrt(square);
  }
  return sum;
}

/// Makes the emissive triangle for face `face` of an emissive mesh. The triangle's radiance is 0 if
/// the face does not emit. The triangle's opacity is 0 if the face is fully transparent.
EmissiveTriangle emissive_triangle(const SceneGeometry& geometry, const SceneMaterials& materials,
                                   const EmissiveMesh& source, size_t face) {
  const Mesh& mesh = *source.mesh;
  const uint32_t material = material_of(mesh, *source.instance, face);
  EmissiveTriangle t{};
  const Material& m = materials.shaded[material];
  t.mesh_light = source.mesh_light;
  t.instance = source.instance_id;
  t.mesh = source.mesh_id;
  t.prim = static_cast<uint32_t>(face);
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
  set_mean_emission(geometry, materials, m, t);
  // Ignore the opacity of invisible mesh lights, which emit although no ray can hit their mesh.
  if (mesh.mesh_light == kNoLight || geometry.mesh_lights[mesh.mesh_light].visible)
    set_mean_opacity(geometry, materials, m, t);
  if (m.has_texture(Input::kEmission) || m.emission_graph != kNoGraph || t.opacity_varies)
    t.material = material;
  return t;
}

}  // namespace

SceneLights::SceneLights(std::vector<Light> all, const SceneGeometry& geometry,
                         const SceneMaterials& materials, const SceneLights* before)
    : lights(std::move(all)) {
  // Each triangle of a mesh that emits becomes a light.
  std::vector<EmissiveMesh> sources;
  size_t triangle_count = 0;
  const auto emits = [&](uint32_t material) {
    return can_aim_at(materials.shaded[material], *materials.graphs);
  };
  const Affine identity{};
  std::vector<MeshLightInstance> light_instances;
  const bool any = materials.has_emission || !geometry.mesh_lights.empty();
  for (size_t i = 0; any && i < geometry.instance_records.size(); ++i) {
    const InstanceRecord& record = geometry.instance_records[i];
    const Group& group = geometry.groups[i == 0 ? 0 : geometry.instances[i - 1].group];
    for (uint32_t mesh_id : group.meshes) {
      const Mesh& mesh = geometry.meshes[mesh_id];
      // Light sampling cannot aim at moving meshes, whose triangles depend on the time of the path.
      // Only paths that hit a moving mesh find its emission.
      const bool moves = mesh.deforms() || (i > 0 && geometry.instances[i - 1].motion.moves());
      const Light* const light =
          mesh.mesh_light == kNoLight ? nullptr : &geometry.mesh_lights[mesh.mesh_light];
      const bool is_emissive = geometry.any_material(mesh_id, record.material, emits);
      const bool independent = light && light->sync == MaterialSync::kIndependent;
      const bool emits_light = !moves && mesh.triangle_count() > 0 && (is_emissive || independent);
      emissive.push_back(emits_light ? static_cast<uint32_t>(triangle_count) : kNoLight);
      const Affine& to_world = i == 0 ? identity : geometry.instances[i - 1].to_world;
      if (!geometry.mesh_lights.empty())
        mesh_lights.push_back(light ? static_cast<uint32_t>(light_instances.size()) : kNoLight);
      const uint32_t mesh_light = light ? mesh_lights.back() : kNoLight;
      if (light)
        light_instances.push_back({light, to_world, world_area(mesh, to_world), emits_light});
      if (!emits_light) continue;
      sources.push_back({triangle_count, &mesh, mesh_id, static_cast<uint32_t>(i), &record,
                         &to_world, mesh_light});
      triangle_groups.push_back(
          {static_cast<uint32_t>(triangle_count), mesh.light_group, mesh.mesh_light != kNoLight});
      triangle_count += mesh.triangle_count();
    }
  }
  const auto triangle = [&](size_t i) {
    const auto next = std::upper_bound(sources.begin(), sources.end(), i,
                                       [](size_t n, const EmissiveMesh& m) { return n < m.first; });
    const EmissiveMesh& source = *std::prev(next);
    return emissive_triangle(geometry, materials, source, i - source.first);
  };
  set = build_lights({.lights = lights,
                      .triangle_count = triangle_count,
                      .triangle = triangle,
                      .scene_radius = geometry.radius,
                      .textures = geometry.textures,
                      .before = before ? &before->set : nullptr,
                      .profiles = geometry.profiles,
                      .mesh_lights = light_instances,
                      .tree_time = TreeTime::kWhenChosen,
                      .filters = geometry.filters});
  // Convert the entries of `emissive` and `mesh_lights` to light indices. Until here, they count
  // from the first triangle and from the first mesh light.
  for (std::vector<uint32_t>* table : {&emissive, &mesh_lights})
    for (uint32_t& entry : *table)
      if (entry != kNoLight) entry += set.first_triangle();
}

const LightTree& SceneLights::tree(uint32_t threads) const {
  if (set.powers.empty()) return set.tree;
  std::call_once(grown_, [&] {
    with_threads(threads, [&] { lazy_tree_ = build_light_tree(set, set.powers); });
    lazy_bytes_ = bytes_of(lazy_tree_);
  });
  return lazy_tree_;
}

uint64_t SceneLights::tree_bytes() const {
  return bytes_of(set.tree) + lazy_bytes_;
}

template <typename T, typename OfInput, typename OfRun>
std::vector<T> Scene::for_all_lights(const OfInput& of_input, const OfRun& of_run) const {
  const LightSet& set = lights_->set;
  const auto& runs = lights_->triangle_groups;
  std::vector<T> values(set.size());
  for (size_t i = 0; i < lights().size(); ++i) values[set.of_input[i]] = of_input(lights()[i]);
  for (size_t run = 0; run < runs.size(); ++run) {
    const size_t first = set.first_triangle() + runs[run].first;
    const size_t end =
        run + 1 < runs.size() ? set.first_triangle() + runs[run + 1].first : values.size();
    std::fill(values.begin() + static_cast<std::ptrdiff_t>(first),
              values.begin() + static_cast<std::ptrdiff_t>(end), of_run(runs[run]));
  }
  return values;
}

std::vector<uint32_t> Scene::groups_of_lights() const {
  return for_all_lights<uint32_t>([](const Light& light) { return light.group; },
                                  [](const SceneLights::TriangleGroup& run) { return run.group; });
}

std::vector<uint8_t> Scene::lights_of_objects() const {
  return for_all_lights<uint8_t>(
      [](const Light& /*light*/) { return uint8_t{0}; },
      [](const SceneLights::TriangleGroup& run) { return uint8_t{!run.is_light}; });
}

}  // namespace wavecomb
