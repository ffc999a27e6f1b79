// SPDX-License-Identifier: Apache-2.0
/// Functions of SceneBuilder that add objects to a scene.
#include <algorithm>
#include <limits>
#include <utility>

#include "wavecomb/core/error.h"
#include "wavecomb/geometry/mesh/checks.h"
#include "wavecomb/graph/parameters/parameters.h"
#include "wavecomb/light/description/light_table.h"
#include "wavecomb/medium/description/volume_motion.h"
#include "wavecomb/scene/camera/camera_table.h"
#include "wavecomb/scene/parallel.h"
#include "wavecomb/scene/scene.h"
#include "wavecomb/scene/scene_checks.h"
#include "wavecomb/scene/scene_limits.h"
#include "wavecomb/texture/tile_store.h"

namespace wavecomb {

namespace {

/// A grid that counts towards the memory limit of a texture store while the grid is in use.
struct CountedGrid {
  std::shared_ptr<const VolumeGrid> grid;
  std::shared_ptr<TileStore> store;

  CountedGrid(std::shared_ptr<const VolumeGrid> g, std::shared_ptr<TileStore> s)
      : grid(std::move(g)), store(std::move(s)) {
    store->register_grid(grid.get(), grid->bytes());
  }
  CountedGrid(const CountedGrid&) = delete;
  CountedGrid& operator=(const CountedGrid&) = delete;
  ~CountedGrid() { store->unregister_grid(grid.get()); }
};

std::shared_ptr<const VolumeGrid> counted(const std::shared_ptr<const VolumeGrid>& grid,
                                          const std::shared_ptr<TileStore>& store) {
  const VolumeGrid* const at = grid.get();
  return {std::make_shared<const CountedGrid>(grid, store), at};
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
  if (static_cast<uint32_t>(material.program) >= kSurfaceProgramCount)
    throw Error(quoted("material", material.name) + " has program '" +
                info_of(material.program).name + "', which is not for surfaces; choose another");
  const bool is_emissive = material.emission.x > 0 || material.emission.y > 0 ||
                           material.emission.z > 0 || material.has_texture(Input::kEmission);
  if (is_emissive && !material.emits())
    warnings_.push_back(quoted("material", material.name) + " has emission, which its program '" +
                        kProgramNames[static_cast<size_t>(material.program)] +
                        "' does not read; use emissive or principled");
  materials_.push_back(std::move(material));
  return static_cast<uint32_t>(materials_.size() - 1);
}

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
                " has a transform that is not finite; give finite numbers");
  if (steps.size() == 1 || steps.size() > kMaxSteps)
    throw Error("the motion of an instance of " + quoted("group", groups_[child].name) +
                " needs 2 to " + std::to_string(kMaxSteps) + " steps");
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

uint32_t SceneBuilder::add_light_filter(LightFilter filter) {
  check_filter(filter, textures_.size(), filters_.size());
  filters_.push_back(filter);
  return static_cast<uint32_t>(filters_.size() - 1);
}

uint32_t SceneBuilder::add_geometry_set(GeometrySet set) {
  std::ranges::sort(set.entries, {}, &GeometrySet::Entry::path);
  sets_.push_back(std::move(set));
  return static_cast<uint32_t>(sets_.size() - 1);
}

void SceneBuilder::add_visibility(VisibilityRule rule) {
  visibility_.push_back(std::move(rule));
}

uint32_t SceneBuilder::add_light(Light light) {
  check_light(light, {textures_.size(), profiles_.size(), sets_.size(), filters_.size()});
  lights_.push_back(std::move(light));
  return static_cast<uint32_t>(lights_.size() - 1);
}

uint32_t SceneBuilder::add_mesh_light(Light light) {
  light.kind = kMeshLight;
  check_mesh_light(light, {textures_.size(), profiles_.size(), sets_.size(), filters_.size()});
  mesh_lights_.push_back(std::move(light));
  return static_cast<uint32_t>(mesh_lights_.size() - 1);
}

uint32_t SceneBuilder::add_volume(Volume volume) {
  check_volume(volume);
  if (store_)
    for (VolumeField* field : {&volume.density, &volume.color, &volume.glow, &volume.velocity})
      if (field->grid) field->grid = counted(field->grid, store_);
  if (volume.moves()) {
    const auto known = std::find_if(volumes_.rbegin(), volumes_.rend(), [&](const Volume& other) {
      return other.motion && has_same_motion(other, volume);
    });
    volume.motion =
        known != volumes_.rend() ? known->motion : std::make_shared<const VolumeMotion>(volume);
  }
  volumes_.push_back(std::move(volume));
  if (volumes_.size() > kMaxVolumes)
    throw Error("more than " + with_commas(kMaxVolumes) + " volumes, " +
                quoted("volume", volumes_.back().name) + " among them; put some into one grid");
  return static_cast<uint32_t>(volumes_.size() - 1);
}

void SceneBuilder::set_camera(const Camera& camera) {
  check_camera(camera);
  camera_ = camera;
}

}  // namespace wavecomb
