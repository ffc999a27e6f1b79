// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/scene/scene.h"

#include <algorithm>
#include <cmath>
#include <cstring>

#include "wavecomb/core/error.h"
#include "wavecomb/scene/check_curves.h"
#include "wavecomb/scene/parallel.h"

namespace wavecomb {
namespace {

constexpr uint64_t kUncounted = ~uint64_t{0};
constexpr uint64_t kMaxInstances = 0x0fffffff;
constexpr uint32_t kMaxNesting = 4096;

std::string quoted(const std::string& kind, const std::string& name) {
  return kind + (name.empty() ? "" : " '" + name + "'");
}

bool finite(const Vec3<float>& v) {
  return std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z);
}

bool finite(const Affine& m) {
  return finite(m.row[0]) && finite(m.row[1]) && finite(m.row[2]) && finite(m.t);
}

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

uint64_t Scene::unique_triangles() const {
  uint64_t n = 0;
  for (const Mesh& mesh : meshes_) n += mesh.triangle_count();
  return n;
}

uint64_t Scene::curve_segments() const {
  uint64_t n = 0;
  for (const Mesh& mesh : meshes_)
    if (mesh.is_curved() && mesh.primitive != Primitive::kSphere) n += mesh.primitive_count();
  return n;
}

uint64_t Scene::points() const {
  uint64_t n = 0;
  for (const Mesh& mesh : meshes_)
    if (mesh.primitive == Primitive::kSphere) n += mesh.primitive_count();
  return n;
}

SceneBytes Scene::bytes() const {
  SceneBytes b;
  for (const Mesh& m : meshes_)
    b.meshes += m.positions.size_bytes() + m.indices.size_bytes() + m.normals.size_bytes() +
                m.uvs.size_bytes() + m.face_materials.size_bytes() + m.radii.size_bytes();
  for (const auto& texture : textures_) b.textures += texture->bytes();
  const auto of = [](const auto& v) { return v.size() * sizeof(v[0]); };
  b.records =
      of(meshes_) + of(instances_) + of(materials_) + of(mesh_records_) + of(instance_records_) +
      of(geometry_mesh_) + of(emissive_lights_) + of(material_program_) + of(material_records_) +
      of(use_records_) + of(texture_views_) + of(light_set_.records) + of(light_set_.triangles) +
      of(light_set_.triangle_uvs) + of(light_set_.pick_bins) + of(placements_) + names_.bytes();
  for (const Distribution2D& d : light_set_.distributions)
    b.records += of(d.cumulative) + of(d.coarse);
  return b;
}

uint64_t Scene::instanced_triangles() const {
  std::vector<uint64_t> of_group(groups_.size(), 0);
  for (size_t g = 0; g < groups_.size(); ++g)
    for (uint32_t mesh : groups_[g].meshes) of_group[g] += meshes_[mesh].triangle_count();
  uint64_t n = of_group[0];
  for (const Instance& i : instances_) n += of_group[i.group];
  return n;
}

SceneBuilder::SceneBuilder(uint32_t threads) : threads_(threads), groups_(1), children_(1) {
  groups_[0].name = "world";
}

uint32_t SceneBuilder::add_texture(const TextureDesc& desc) {
  with_threads(threads_,
               [&] { textures_.push_back(std::make_unique<Texture>(desc, parallel_for)); });
  return static_cast<uint32_t>(textures_.size() - 1);
}

uint32_t SceneBuilder::add_material(Material material) {
  const auto name = quoted("material", material.name);
  for (uint32_t s = 0; s < kSlotCount; ++s) {
    const TextureUse& use = material.textures[s];
    if (use.texture == kNoTexture) continue;
    if (use.texture >= textures_.size())
      throw Error(name + " reads texture " + std::to_string(use.texture) +
                  ", which was never added; add textures before materials");
    for (const std::span<const float> values :
         {std::span<const float>(use.scale), std::span<const float>(use.bias),
          std::span<const float>(use.uv)})
      for (float x : values)
        if (!std::isfinite(x))
          throw Error(name +
                      " reads a texture through a number that is not finite; mend its scale, bias "
                      "or transform");
    if (use.channel > 4)
      throw Error(name + " reads a texture channel that is not r, g, b, a or rgb");
  }
  for (const Vec3<float>& v : {material.base_color, material.specular_color, material.emission,
                               material.conductor_eta, material.conductor_k})
    if (!finite(v)) throw Error(name + " has a colour that is not finite; give finite numbers");
  for (float x :
       {material.roughness, material.metallic, material.clearcoat, material.clearcoat_roughness,
        material.opacity, material.ior, material.opacity_threshold})
    if (!std::isfinite(x))
      throw Error(name + " has a parameter that is not finite; give finite numbers");
  if (material.ior <= 0) throw Error(name + " has an ior of 0 or less; give a positive one");
  if (material.evaluations < 1 || material.evaluations > kMaxEvaluations)
    throw Error(name + " has " + std::to_string(material.evaluations) + " evaluations; from 1 to " +
                std::to_string(kMaxEvaluations) + " are possible");
  const bool glows = material.emission.x > 0 || material.emission.y > 0 ||
                     material.emission.z > 0 || material.has_texture(Slot::kEmission);
  if (glows && !material.emits())
    warnings_.push_back(name + " has emission, which its program '" +
                        kProgramNames[static_cast<size_t>(material.program)] +
                        "' does not read; use emissive or principled");
  materials_.push_back(std::move(material));
  return static_cast<uint32_t>(materials_.size() - 1);
}

uint32_t SceneBuilder::add_mesh(Mesh mesh) {
  const auto name = quoted("mesh", mesh.name);
  if (mesh.positions.size() % 3 != 0) throw Error(name + ": positions must be triples");
  if (mesh.is_curved()) {
    check_curves(mesh, name);
    meshes_.push_back(std::move(mesh));
    return static_cast<uint32_t>(meshes_.size() - 1);
  }
  if (mesh.indices.size() % 3 != 0) throw Error(name + ": indices must be triples");
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
  check_attribute(mesh, mesh.normals, mesh.normals_at, 3, "normals");
  check_attribute(mesh, mesh.uvs, mesh.uvs_at, 2, "texture coordinates");
  if (!mesh.face_materials.empty() && mesh.face_materials.size() != mesh.triangle_count())
    throw Error(name + " has " + std::to_string(mesh.face_materials.size()) +
                " face materials for " + std::to_string(mesh.triangle_count()) + " triangles");
  meshes_.push_back(std::move(mesh));
  return static_cast<uint32_t>(meshes_.size() - 1);
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
                                uint32_t material, uint32_t name, uint32_t number) {
  if (parent >= groups_.size() || child >= groups_.size())
    throw Error("an instance names a group that was never added");
  if (child == 0) throw Error("the world cannot be instanced; make a group");
  if (!finite(transform))
    throw Error("an instance of " + quoted("group", groups_[child].name) +
                " has a transform that is not finite; mend it");
  children_[parent].push_back({child, transform, material, name, number});
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

uint32_t SceneBuilder::add_light(Light light) {
  const auto name = quoted("light", light.name);
  if (!finite(light.to_world)) throw Error(name + " has a transform that is not finite; mend it");
  if (!finite(light.color) || light.color.x < 0 || light.color.y < 0 || light.color.z < 0)
    throw Error(name + " has a colour that is negative or not finite; give one of 0 or more");
  for (float x : {light.width, light.height, light.radius, light.angle})
    if (!std::isfinite(x) || x < 0)
      throw Error(name + " has a size that is negative or not finite; give one of 0 or more");
  if (light.texture != kNoTexture && light.texture >= textures_.size())
    throw Error(name + " reads a texture that was never added; add textures before lights");
  lights_.push_back(std::move(light));
  return static_cast<uint32_t>(lights_.size() - 1);
}

void SceneBuilder::set_camera(const Camera& camera) {
  const float* w = camera.window;
  if (!finite(camera.to_world) || std::abs(camera.to_world.determinant()) < 1e-30f)
    throw Error("the camera's transform is singular or not finite; mend it");
  for (int i = 0; i < 4; ++i)
    if (!std::isfinite(w[i])) throw Error("the camera's window is not finite; check its aperture");
  if (!(w[0] < w[1]) || !(w[2] < w[3]))
    throw Error("the camera's window is empty; check its aperture and focal length");
  if (!(camera.lens_radius >= 0) || !std::isfinite(camera.lens_radius) ||
      (camera.lens_radius > 0 && !(camera.focus_distance > 0)))
    throw Error("the camera's lens needs a radius of 0 or more and a focus distance above 0");
  if (!(camera.near_clip >= 0) || !(camera.far_clip > camera.near_clip))
    throw Error("the camera's clipping range must start at 0 or more and end beyond its start");
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
    if (count > kMaxInstances) throw Error("more than 268 million instances; use fewer");
  }
  return known = count;
}

void SceneBuilder::flatten(uint32_t group, const Instance& here,
                           const std::vector<uint64_t>& counts, std::vector<Instance>& out,
                           std::vector<Placement>& placements) const {
  if (group != 0 && !groups_[group].meshes.empty()) out.push_back(here);
  for (const Node& node : children_[group]) {
    if (counts[node.child] == 0) continue;
    const auto placement = static_cast<uint32_t>(placements.size());
    placements.push_back({here.placement, node.child, node.name, node.number});
    flatten(node.child,
            {node.child, here.to_world * node.transform,
             node.material == kInheritMaterial ? here.material : node.material, placement},
            counts, out, placements);
  }
}

std::shared_ptr<const Scene> SceneBuilder::build() {
  std::shared_ptr<Scene> scene(new Scene);
  // Counted first: shared groups can be placed in 2^n ways, and most of them may hold nothing.
  std::vector<uint64_t> placements(groups_.size(), kUncounted);
  std::vector<Instance> flat;
  flat.reserve(count_placements(0, 0, placements));
  flatten(0, {0, Affine{}, kInheritMaterial, kNoName}, placements, flat, scene->placements_);
  size_t singular = 0;
  for (Instance& i : flat) {
    const float det = i.to_world.determinant();
    if (finite(i.to_world) && std::isfinite(det) && std::abs(det) > 1e-35f)
      scene->instances_.push_back(std::move(i));
    else
      ++singular;
  }
  if (singular > 0)
    warnings_.push_back(std::to_string(singular) +
                        " instances have a singular transform and were left out");

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
  for (Instance& i : scene->instances_) {
    if (i.material == kInheritMaterial) i.material = grey;
    if (i.material > grey) throw Error("an instance uses a material that was never added");
  }

  scene->meshes_ = std::move(meshes_);
  scene->groups_ = std::move(groups_);
  scene->materials_ = std::move(materials_);
  scene->textures_ = std::move(textures_);
  scene->lights_ = std::move(lights_);
  scene->light_groups_ = std::move(light_groups_);
  scene->names_ = std::move(names_);
  scene->camera_ = camera_;
  with_threads(threads_, [&] {
    make_records(*scene);
    make_lights(*scene);
  });
  scene->warnings_ = std::move(warnings_);
  *this = SceneBuilder(threads_);
  return scene;
}

void SceneBuilder::make_records(Scene& scene) const {
  scene.mesh_records_.resize(scene.meshes_.size());
  parallel_for(scene.meshes_.size(),
               [&](size_t m) { scene.mesh_records_[m] = make_mesh_record(scene.meshes_[m]); });
  for (const auto& texture : scene.textures_) scene.texture_views_.push_back(texture->view());
  for (const Material& m : scene.materials_) {
    scene.material_records_.push_back(make_material_record(m));
    for (const TextureUse& use : m.textures) scene.use_records_.push_back(make_use_record(use));
    scene.material_program_.push_back(static_cast<uint32_t>(m.program));
  }

  std::vector<uint32_t> first(scene.groups_.size());
  std::vector<Bounds> bounds(scene.groups_.size());
  for (size_t g = 0; g < scene.groups_.size(); ++g) {
    first[g] = static_cast<uint32_t>(scene.geometry_mesh_.size());
    const auto& meshes = scene.groups_[g].meshes;
    scene.geometry_mesh_.insert(scene.geometry_mesh_.end(), meshes.begin(), meshes.end());
  }
  parallel_for(scene.groups_.size(), [&](size_t g) {
    for (uint32_t mesh : scene.groups_[g].meshes) {
      const auto& p = scene.meshes_[mesh].positions;
      const auto& radii = scene.meshes_[mesh].radii;
      for (size_t i = 0; i + 2 < p.size(); i += 3) {
        const float r = radii.empty() ? 0.f : radii[i / 3];
        bounds[g].add({p[i] - r, p[i + 1] - r, p[i + 2] - r});
        bounds[g].add({p[i] + r, p[i + 1] + r, p[i + 2] + r});
      }
    }
  });
  const auto grey = static_cast<uint32_t>(scene.materials_.size() - 1);
  scene.instance_records_.push_back(make_instance_record(Affine{}, grey));
  scene.bounds_ = bounds[0];
  for (const Instance& i : scene.instances_) {
    InstanceRecord r = make_instance_record(i.to_world, i.material);
    r.geometry = first[i.group];
    scene.instance_records_.push_back(r);
    const Bounds& b = bounds[i.group];
    if (b.empty()) continue;
    for (int corner = 0; corner < 8; ++corner)
      scene.bounds_.add(
          i.to_world.point({corner & 1 ? b.hi.x : b.lo.x, corner & 2 ? b.hi.y : b.lo.y,
                            corner & 4 ? b.hi.z : b.lo.z}));
  }
}

}  // namespace wavecomb
