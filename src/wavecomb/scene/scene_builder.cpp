// SPDX-License-Identifier: Apache-2.0
/// SceneBuilder.
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <utility>

#include "wavecomb/core/error.h"
#include "wavecomb/curve/check.h"
#include "wavecomb/graph/parameters.h"
#include "wavecomb/scene/camera_table.h"
#include "wavecomb/scene/light_table.h"
#include "wavecomb/scene/mesh_attributes.h"
#include "wavecomb/scene/parallel.h"
#include "wavecomb/scene/scene.h"
#include "wavecomb/scene/scene_checks.h"
#include "wavecomb/scene/scene_limits.h"

namespace wavecomb {
namespace {

constexpr uint64_t kUncounted = ~uint64_t{0};
/// What an instance takes at least, Embree's geometry for it before all.
constexpr uint64_t kInstanceBytes = 400;

/// Instances that can be numbered and that the memory of this machine holds.
uint64_t max_instances() {
  const long pages = sysconf(_SC_PHYS_PAGES), page_bytes = sysconf(_SC_PAGE_SIZE);
  if (pages <= 0 || page_bytes <= 0) return kMaxInstances;
  return std::min(kMaxInstances, static_cast<uint64_t>(pages) * static_cast<uint64_t>(page_bytes) /
                                     kInstanceBytes);
}
constexpr uint32_t kMaxNesting = 4096;

/// Attribute arrays must have 'arity' floats per vertex or per corner.
void check_attribute(const Mesh& mesh, std::span<const float> values, Attribute at, size_t arity,
                     const char* what) {
  if (at == Attribute::kNone) return;
  const size_t want =
      arity * (at == Attribute::kVertex ? mesh.vertex_count() : mesh.indices.size());
  if (values.size() != want)
    throw Error(quoted("mesh", mesh.name) + " has " + std::to_string(values.size() / arity) + " " +
                what + " where " + std::to_string(want / arity) + " are needed");
}

uint64_t address(const void* p) {
  return reinterpret_cast<uint64_t>(p);
}

/// sqrt(uv area / area) of the whole mesh, 0 where it has no uvs.
float uv_density(const Mesh& mesh) {
  if (mesh.uvs_at == Attribute::kNone || mesh.is_curved()) return 0;
  double area = 0, uv_area = 0;
  for (size_t f = 0; f < mesh.triangle_count(); ++f) {
    const float *p[3], *t[3];
    for (size_t k = 0; k < 3; ++k) {
      const size_t vertex = mesh.indices[3 * f + k];
      p[k] = &mesh.positions[3 * vertex];
      t[k] = &mesh.uvs[2 * (mesh.uvs_at == Attribute::kCorner ? 3 * f + k : vertex)];
    }
    const double a[3] = {double{p[1][0]} - p[0][0], double{p[1][1]} - p[0][1],
                         double{p[1][2]} - p[0][2]};
    const double b[3] = {double{p[2][0]} - p[0][0], double{p[2][1]} - p[0][1],
                         double{p[2][2]} - p[0][2]};
    const double x = a[1] * b[2] - a[2] * b[1], y = a[2] * b[0] - a[0] * b[2],
                 z = a[0] * b[1] - a[1] * b[0];
    area += std::sqrt(x * x + y * y + z * z);
    uv_area += std::abs((double{t[1][0]} - t[0][0]) * (double{t[2][1]} - t[0][1]) -
                        (double{t[1][1]} - t[0][1]) * (double{t[2][0]} - t[0][0]));
  }
  const double density = area > 0 ? std::sqrt(uv_area / area) : 0;
  return std::isfinite(density) ? static_cast<float>(density) : 0.f;
}

MeshRecord make_mesh_record(const Mesh& mesh) {
  MeshRecord r{};
  r.positions = address(mesh.positions.data());
  r.indices = address(mesh.indices.data());
  r.normals = address(mesh.normals.data());
  r.uvs = address(mesh.uvs.data());
  r.face_materials = address(mesh.face_materials.empty() ? nullptr : mesh.face_materials.data());
  r.radii = address(mesh.radii.data());
  r.material = mesh.material;
  r.uv_density = uv_density(mesh);
  if (mesh.normals_at == Attribute::kVertex) r.flags |= kNormalsPerVertex;
  if (mesh.normals_at == Attribute::kCorner) r.flags |= kNormalsPerCorner;
  if (mesh.uvs_at == Attribute::kVertex) r.flags |= kUvsPerVertex;
  if (mesh.uvs_at == Attribute::kCorner) r.flags |= kUvsPerCorner;
  if (mesh.is_curved()) r.flags |= curve_flags(mesh);
  return r;
}

/// The values of `all`, each once, ascending.
std::vector<uint32_t> distinct(std::span<const uint32_t> all) {
  std::vector<uint32_t> values;
  for (uint32_t value : all)
    if (values.empty() || values.back() != value) values.push_back(value);
  std::sort(values.begin(), values.end());
  values.erase(std::unique(values.begin(), values.end()), values.end());
  values.shrink_to_fit();
  return values;
}

InstanceRecord make_instance_record(const Affine& m, uint32_t material) {
  InstanceRecord r{};
  for (int i = 0; i < 3; ++i) {
    r.to_world[4 * i] = m.row[i].x;
    r.to_world[4 * i + 1] = m.row[i].y;
    r.to_world[4 * i + 2] = m.row[i].z;
  }
  r.to_world[3] = m.t.x;
  r.to_world[7] = m.t.y;
  r.to_world[11] = m.t.z;
  r.material = material;
  r.side = m.determinant() < 0 ? -1.f : 1.f;
  return r;
}

}  // namespace

SceneBuilder::SceneBuilder(uint32_t threads, std::shared_ptr<TileStore> store)
    : threads_(threads), store_(std::move(store)), groups_(1), children_(1) {
  groups_[0].name = "world";
}

uint32_t SceneBuilder::add_texture(const TextureDesc& desc) {
  with_threads(threads_, [&] {
    textures_.push_back(std::make_shared<const Texture>(desc, parallel_for, store_));
  });
  return static_cast<uint32_t>(textures_.size() - 1);
}

uint32_t SceneBuilder::add_texture(TexturePtr texture) {
  textures_.push_back(std::move(texture));
  return static_cast<uint32_t>(textures_.size() - 1);
}

uint32_t SceneBuilder::add_tiles(const std::string& name,
                                 const std::vector<std::pair<uint32_t, uint32_t>>& tiles,
                                 const std::array<float, 4>& missing) {
  std::vector<std::pair<uint32_t, TexturePtr>> parts;
  for (const auto& [number, id] : tiles) {
    texture(id);
    parts.emplace_back(number, textures_[id]);
  }
  return add_texture(std::make_shared<const Texture>(name, parts, missing));
}

const Texture& SceneBuilder::texture(uint32_t id) const {
  if (id >= textures_.size()) throw Error("texture " + std::to_string(id) + " was never added");
  return *textures_[id];
}

uint32_t SceneBuilder::add_graph(const Graph& graph) {
  check_graph(graph, "graph " + std::to_string(graphs_.programs.size()), textures_.size(),
              kGraphOutputCount);
  if (graph.attributes.empty()) {
    graphs_.add(graph);
  } else {
    Graph numbered = graph;
    for (GraphOp& op : numbered.ops) {
      if (static_cast<GraphCode>(op.code) != GraphCode::kAttribute) continue;
      const uint32_t id = attribute(graph.attributes[op.number]);
      if (id > std::numeric_limits<uint16_t>::max())
        throw Error("graphs read more than 65536 different attributes; use fewer");
      op.number = static_cast<uint16_t>(id);
    }
    graphs_.add(numbered);
  }
  return static_cast<uint32_t>(graphs_.programs.size() - 1);
}

uint32_t SceneBuilder::add_material(Material material) {
  check_material(material, textures_.size(), graphs_.programs.size());
  const bool glows = material.emission.x > 0 || material.emission.y > 0 ||
                     material.emission.z > 0 || material.has_texture(Slot::kEmission);
  if (glows && !material.emits())
    warnings_.push_back(quoted("material", material.name) + " has emission, which its program '" +
                        kProgramNames[static_cast<size_t>(material.program)] +
                        "' does not read; use emissive or principled");
  materials_.push_back(std::move(material));
  return static_cast<uint32_t>(materials_.size() - 1);
}

namespace {

/// What add_mesh and replace_mesh ask of a mesh. `names`: of attributes.
void check_mesh(const Mesh& mesh, const std::vector<std::string>& names) {
  const auto name = quoted("mesh", mesh.name);
  if (mesh.positions.size() % 3 != 0) throw Error(name + ": positions must be triples");
  if (mesh.is_curved()) {
    check_curves(mesh, name);
    check_attributes(mesh, name, names);
    return;
  }
  if (mesh.indices.size() % 3 != 0) throw Error(name + ": indices must be triples");
  if (mesh.steps < 1 || mesh.steps > kMostSteps || mesh.positions.size() % (3 * mesh.steps) != 0)
    throw Error(name + " needs as many points at each of 1 to " + std::to_string(kMostSteps) +
                " steps of its motion");
  if (mesh.vertex_count() > 0x7fffffffu / 3 || mesh.triangle_count() > 0x7fffffffu / 9)
    throw Error(name + " has too many points or triangles for 32-bit offsets; split it");
  for (float x : mesh.positions)
    if (!std::isfinite(x))
      throw Error(name + " has points that are not finite (NaN or infinite); mend or remove them");
  const size_t vertices = mesh.vertex_count();
  uint32_t highest = 0;
  for (uint32_t i : mesh.indices) highest = std::max(highest, i);
  if (!mesh.indices.empty() && highest >= vertices)
    throw Error(name + " has a face with vertex " + std::to_string(highest) + " but only " +
                std::to_string(vertices) + " points");
  check_attribute(mesh, mesh.normals, mesh.normals_at, size_t{3} * mesh.steps, "normals");
  check_attribute(mesh, mesh.uvs, mesh.uvs_at, 2, "texture coordinates");
  if (!mesh.face_materials.empty() && mesh.face_materials.size() != mesh.triangle_count())
    throw Error(name + " has " + std::to_string(mesh.face_materials.size()) +
                " face materials for " + std::to_string(mesh.triangle_count()) + " triangles");
  check_attributes(mesh, name, names);
}

}  // namespace

uint32_t SceneBuilder::attribute(const std::string& name) {
  const auto [at, is_new] =
      attribute_ids_.try_emplace(name, static_cast<uint32_t>(attribute_names_.size()));
  if (is_new) attribute_names_.push_back(name);
  return at->second;
}

uint32_t SceneBuilder::add_mesh(Mesh mesh) {
  check_mesh(mesh, attribute_names_);
  if (mesh.mesh_light != kNoLight && mesh.mesh_light >= mesh_lights_.size())
    throw Error(quoted("mesh", mesh.name) + " has a mesh light that was never added");
  meshes_.push_back(std::move(mesh));
  return static_cast<uint32_t>(meshes_.size() - 1);
}

void SceneBuilder::replace_mesh(uint32_t id, Mesh mesh) {
  if (id >= meshes_.size()) throw Error("mesh " + std::to_string(id) + " was never added");
  Mesh& old = meshes_[id];
  mesh.name = old.name;
  mesh.light_group = old.light_group;
  mesh.mesh_light = old.mesh_light;
  mesh.asset_length = old.asset_length;
  check_mesh(mesh, attribute_names_);
  old = std::move(mesh);
}

uint32_t SceneBuilder::add_group(std::string name, std::string root) {
  groups_.push_back({std::move(name), {}, std::move(root)});
  children_.emplace_back();
  return static_cast<uint32_t>(groups_.size() - 1);
}

void SceneBuilder::add_to_group(uint32_t group, uint32_t mesh) {
  if (group >= groups_.size()) throw Error("group " + std::to_string(group) + " was never added");
  if (mesh >= meshes_.size()) throw Error("mesh " + std::to_string(mesh) + " was never added");
  groups_[group].meshes.push_back(mesh);
}

void SceneBuilder::add_instance(uint32_t parent, uint32_t child, const Affine& transform,
                                uint32_t material, uint32_t name, uint32_t number,
                                std::span<const Affine> steps) {
  if (parent >= groups_.size() || child >= groups_.size())
    throw Error("an instance names a group that was never added");
  if (child == 0) throw Error("the world cannot be instanced; make a group");
  if (!finite(transform) ||
      !std::all_of(steps.begin(), steps.end(), [](const Affine& m) { return finite(m); }))
    throw Error("an instance of " + quoted("group", groups_[child].name) +
                " has a transform that is not finite; mend it");
  if (steps.size() == 1 || steps.size() > kMostSteps)
    throw Error("the motion of an instance of " + quoted("group", groups_[child].name) +
                " needs 2 to " + std::to_string(kMostSteps) + " steps");
  StepRange motion;
  if (!steps.empty())
    motion = {static_cast<uint32_t>(node_steps_.size()), static_cast<uint32_t>(steps.size() - 1)};
  node_steps_.insert(node_steps_.end(), steps.begin(), steps.end());
  check_counts({.steps = node_steps_.size()});
  children_[parent].push_back({child, transform, material, name, number, motion});
}

uint32_t SceneBuilder::add_placement_name(std::string_view name, uint32_t asset_length) {
  return names_.add(name, asset_length);
}

uint32_t SceneBuilder::light_group(const std::string& name) {
  const std::string& known = name.empty() ? light_groups_.front() : name;
  const auto at = std::find(light_groups_.begin(), light_groups_.end(), known);
  if (at != light_groups_.end()) return static_cast<uint32_t>(at - light_groups_.begin());
  if (light_groups_.size() == kMaxLightGroups)
    throw Error("more than " + std::to_string(kMaxLightGroups) + " light groups, " +
                quoted("group", name) + " among them; put some together");
  light_groups_.push_back(name);
  return static_cast<uint32_t>(light_groups_.size() - 1);
}

uint32_t SceneBuilder::add_ies(IesProfile profile) {
  check_profile(profile);
  profiles_.push_back(std::move(profile));
  return static_cast<uint32_t>(profiles_.size() - 1);
}

uint32_t SceneBuilder::add_geometry_set(GeometrySet set) {
  std::ranges::sort(set.entries, {}, &GeometrySet::Entry::path);
  sets_.push_back(std::move(set));
  return static_cast<uint32_t>(sets_.size() - 1);
}

uint32_t SceneBuilder::add_light(Light light) {
  check_light(light, {textures_.size(), profiles_.size(), sets_.size()});
  lights_.push_back(std::move(light));
  return static_cast<uint32_t>(lights_.size() - 1);
}

uint32_t SceneBuilder::add_mesh_light(Light light) {
  light.kind = LightKind::kTriangle;
  check_mesh_light(light, {textures_.size(), profiles_.size(), sets_.size()});
  mesh_lights_.push_back(std::move(light));
  return static_cast<uint32_t>(mesh_lights_.size() - 1);
}

void SceneBuilder::set_camera(const Camera& camera) {
  check_camera(camera);
  camera_ = camera;
}

uint64_t SceneBuilder::count_placements(uint32_t group, uint32_t depth,
                                        std::vector<uint64_t>& of_group) const {
  constexpr uint64_t kUnderWay = ~uint64_t{0} - 1;
  uint64_t& known = of_group[group];
  if (known == kUnderWay)
    throw Error(quoted("group", groups_[group].name) +
                " holds itself; break the cycle of instances");
  if (known != kUncounted) return known;
  if (depth > kMaxNesting)
    throw Error("groups are nested more than " + std::to_string(kMaxNesting) +
                " deep; flatten some");
  known = kUnderWay;
  uint64_t count = group != 0 && !groups_[group].meshes.empty() ? 1 : 0;
  for (const Node& node : children_[group]) {
    count += count_placements(node.child, depth + 1, of_group);
    if (count > max_instances())
      throw Error("more than " + std::to_string(max_instances() / 1000000) +
                  " million instances, the most that can be numbered or that this machine's "
                  "memory holds; use fewer");
  }
  return known = count;
}

uint32_t common_segments(uint32_t a, uint32_t b) {
  const uint32_t both = std::lcm(a, b);
  return both < kMostSteps / 2 ? both : std::max(a, b);
}

std::vector<Affine> SceneBuilder::composed(std::span<const Affine> outer, const Affine& still,
                                           const Node& node) const {
  if (outer.empty() && !node.motion.moves()) return {};
  const Affine* const first =
      node.motion.moves() ? &node_steps_[node.motion.first] : &node.transform;
  const std::span<const Affine> inner(first, node.motion.segments + 1);
  if (outer.empty()) outer = {&still, 1};
  const uint32_t n = common_segments(std::max<uint32_t>(1, static_cast<uint32_t>(outer.size() - 1)),
                                     std::max(1u, node.motion.segments));
  std::vector<Affine> steps;
  for (uint32_t k = 0; k <= n; ++k) steps.push_back(at_step(outer, k, n) * at_step(inner, k, n));
  return steps;
}

void SceneBuilder::flatten(uint32_t group, const Instance& here, std::span<const Affine> steps,
                           const std::vector<uint64_t>& counts, std::vector<Instance>& out,
                           SceneGeometry& geometry) const {
  if (group != 0 && !groups_[group].meshes.empty()) {
    out.push_back(here);
    if (!steps.empty()) {
      out.back().motion = {static_cast<uint32_t>(geometry.steps.size()),
                           static_cast<uint32_t>(steps.size() - 1)};
      // What knows one place only takes the middle of the shutter.
      out.back().to_world = at_step(steps, 1, 2);
      for (const Affine& m : steps) geometry.steps.emplace_back(m);
    }
  }
  for (const Node& node : children_[group]) {
    if (counts[node.child] == 0) continue;
    const auto placement = static_cast<uint32_t>(geometry.placements.size());
    geometry.placements.push_back({here.placement, node.child, node.name, node.number});
    const std::vector<Affine> moved = composed(steps, here.to_world, node);
    flatten(node.child,
            {node.child,
             here.to_world * node.transform,
             node.material == kInheritMaterial ? here.material : node.material,
             placement,
             {}},
            moved, counts, out, geometry);
  }
}

std::shared_ptr<const Scene> SceneBuilder::build() {
  auto geometry = std::make_shared<SceneGeometry>();
  // Counted first: shared groups can be placed in 2^n ways, and most of them may hold nothing.
  std::vector<uint64_t> placements(groups_.size(), kUncounted);
  std::vector<Instance> flat;
  flat.reserve(count_placements(0, 0, placements));
  flatten(0, {0, Affine{}, kInheritMaterial, kNoName, {}}, {}, placements, flat, *geometry);
  const auto sound = [](const Affine& m) {
    const float det = m.determinant();
    return finite(m) && std::isfinite(det) && std::abs(det) > 1e-35f;
  };
  size_t singular = 0;
  for (Instance& i : flat) {
    bool good = i.motion.moves() || sound(i.to_world);
    for (uint32_t k = 0; i.motion.moves() && k <= i.motion.segments; ++k)
      good = good && sound(geometry->steps[i.motion.first + k].affine());
    if (good)
      geometry->instances.push_back(std::move(i));
    else
      ++singular;
  }
  if (singular > 0)
    warnings_.push_back(std::to_string(singular) +
                        " instances have a singular transform and were left out");

  SceneCounts counts{.meshes = meshes_.size(),
                     .materials = materials_.size() + 1,
                     .instances = geometry->instances.size(),
                     .placed = groups_[0].meshes.size(),
                     .placements = geometry->placements.size(),
                     .steps = geometry->steps.size()};
  for (const Group& group : groups_) counts.grouped += group.meshes.size();
  for (const Instance& i : geometry->instances) counts.placed += groups_[i.group].meshes.size();
  check_counts(counts);

  // A grey for meshes that nothing was bound to.
  const auto material_count = static_cast<uint32_t>(materials_.size());
  const uint32_t grey = material_count;
  Material fallback;
  fallback.name = "default";
  fallback.program = ProgramId::kDiffuse;
  fallback.base_color = {0.5f, 0.5f, 0.5f};
  materials_.push_back(fallback);
  for (const Mesh& mesh : meshes_) {
    const auto bad = [&](uint32_t m) { return m != kInheritMaterial && m >= material_count; };
    if (bad(mesh.material) ||
        std::any_of(mesh.face_materials.begin(), mesh.face_materials.end(), bad))
      throw Error(quoted("mesh", mesh.name) + " uses a material that was never added");
  }
  for (Instance& i : geometry->instances) {
    if (i.material == kInheritMaterial) i.material = grey;
    if (i.material > grey) throw Error("an instance uses a material that was never added");
  }

  geometry->meshes = std::move(meshes_);
  geometry->groups = std::move(groups_);
  geometry->textures = std::move(textures_);
  geometry->profiles = std::move(profiles_);
  geometry->sets = std::move(sets_);
  geometry->mesh_lights = std::move(mesh_lights_);
  geometry->light_groups = std::move(light_groups_);
  geometry->attribute_names = std::move(attribute_names_);
  geometry->names = std::move(names_);
  geometry->warnings = std::move(warnings_);
  std::shared_ptr<const SceneMaterials> materials;
  std::shared_ptr<const SceneLights> lights;
  with_threads(threads_, [&] {
    make_records(*geometry, grey);
    materials = std::make_shared<const SceneMaterials>(
        std::move(materials_), std::make_shared<const GraphSet>(std::exchange(graphs_, {})));
    lights =
        std::make_shared<const SceneLights>(std::move(lights_), *geometry, *materials, nullptr);
  });
  std::shared_ptr<Scene> scene(
      new Scene(std::move(geometry), std::move(materials), std::move(lights), nullptr, camera_));
  scene->link();
  *this = SceneBuilder(threads_, store_);
  return scene;
}

void SceneBuilder::make_records(SceneGeometry& geometry, uint32_t grey) const {
  const std::vector<Mesh>& meshes = geometry.meshes;
  geometry.mesh_records.resize(meshes.size());
  geometry.mesh_motions.resize(1);
  geometry.face_materials.resize(meshes.size());
  parallel_for(meshes.size(), [&](size_t m) {
    geometry.mesh_records[m] = make_mesh_record(meshes[m]);
    geometry.face_materials[m] = distinct(meshes[m].face_materials);
  });
  for (size_t m = 0; m < meshes.size(); ++m) {
    const Mesh& mesh = meshes[m];
    if (!mesh.deforms()) continue;
    geometry.mesh_records[m].motion = static_cast<uint32_t>(geometry.mesh_motions.size());
    geometry.mesh_motions.push_back({mesh.positions.size_bytes() / mesh.steps,
                                     mesh.normals.size_bytes() / mesh.steps, mesh.steps - 1, 0});
  }
  make_attribute_records(geometry);
  for (const auto& texture : geometry.textures) geometry.texture_views.push_back(texture->view());

  std::vector<uint32_t> first(geometry.groups.size());
  std::vector<Bounds> bounds(geometry.groups.size());
  for (size_t g = 0; g < geometry.groups.size(); ++g) {
    first[g] = static_cast<uint32_t>(geometry.geometry_mesh.size());
    const auto& in_group = geometry.groups[g].meshes;
    geometry.geometry_mesh.insert(geometry.geometry_mesh.end(), in_group.begin(), in_group.end());
  }
  parallel_for(geometry.groups.size(), [&](size_t g) {
    for (uint32_t mesh : geometry.groups[g].meshes) {
      const auto& p = meshes[mesh].positions;
      const auto& radii = meshes[mesh].radii;
      for (size_t i = 0; i + 2 < p.size(); i += 3) {
        const float r = radii.empty() ? 0.f : radii[i / 3 % radii.size()];
        bounds[g].add({p[i] - r, p[i + 1] - r, p[i + 2] - r});
        bounds[g].add({p[i] + r, p[i + 1] + r, p[i + 2] + r});
      }
    }
  });
  geometry.instance_records.reserve(geometry.instances.size() + 1);
  geometry.instance_records.push_back(make_instance_record(Affine{}, grey));
  if (!geometry.steps.empty()) {
    geometry.instance_motions.resize(1);
    for (const Instance& i : geometry.instances) geometry.instance_motions.push_back(i.motion);
  }
  geometry.bounds = bounds[0];
  auto emissive = static_cast<uint32_t>(geometry.groups[0].meshes.size());
  for (const Instance& i : geometry.instances) {
    InstanceRecord r = make_instance_record(i.to_world, i.material);
    r.geometry = first[i.group];
    r.emissive = emissive;
    emissive += static_cast<uint32_t>(geometry.groups[i.group].meshes.size());
    geometry.instance_records.push_back(r);
    const Bounds& b = bounds[i.group];
    if (b.empty()) continue;
    const auto add_box = [&](const Affine& to_world) {
      for (int corner = 0; corner < 8; ++corner)
        geometry.bounds.add(
            to_world.point({corner & 1 ? b.hi.x : b.lo.x, corner & 2 ? b.hi.y : b.lo.y,
                            corner & 4 ? b.hi.z : b.lo.z}));
    };
    if (!i.motion.moves()) add_box(i.to_world);
    for (uint32_t k = 0; i.motion.moves() && k <= i.motion.segments; ++k)
      add_box(geometry.steps[i.motion.first + k].affine());
  }
  if (geometry.bounds.empty()) return;
  const Bounds& b = geometry.bounds;
  const Vec3<float> d = b.hi - (b.lo + b.hi) * 0.5f;
  geometry.radius = std::max(1e-20f, std::sqrt(d.x * d.x + d.y * d.y + d.z * d.z));
}

}  // namespace wavecomb
