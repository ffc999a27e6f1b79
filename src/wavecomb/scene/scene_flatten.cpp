// SPDX-License-Identifier: Apache-2.0
/// Functions of SceneBuilder that flatten nested groups to a list of instances and assemble the
/// scene.
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <utility>

#include "wavecomb/core/error.h"
#include "wavecomb/medium/description/glass_contents.h"
#include "wavecomb/medium/description/mesh_medium.h"
#include "wavecomb/scene/parallel.h"
#include "wavecomb/scene/scene.h"
#include "wavecomb/scene/scene_checks.h"
#include "wavecomb/scene/scene_limits.h"

namespace wavecomb {
namespace {

constexpr uint64_t kUncounted = ~uint64_t{0};
/// Minimum memory of an instance in bytes. Embree's geometry takes most of this memory.
constexpr uint64_t kInstanceBytes = 400;

/// Returns the maximum number of instances that 32-bit indices and the memory of this machine
/// permit.
uint64_t max_instances() {
  const long pages = sysconf(_SC_PHYS_PAGES), page_bytes = sysconf(_SC_PAGE_SIZE);
  if (pages <= 0 || page_bytes <= 0) return kMaxInstances;
  return std::min(kMaxInstances, static_cast<uint64_t>(pages) * static_cast<uint64_t>(page_bytes) /
                                     kInstanceBytes);
}
constexpr uint32_t kMaxNesting = 4096;

}  // namespace

uint64_t SceneBuilder::count_placements(uint32_t group, uint32_t depth,
                                        std::vector<uint64_t>& of_group) const {
  constexpr uint64_t kInProgress = ~uint64_t{0} - 1;
  uint64_t& known = of_group[group];
  if (known == kInProgress)
    throw Error(quoted("group", groups_[group].name) +
                " holds itself; break the cycle of instances");
  if (known != kUncounted) return known;
  if (depth > kMaxNesting)
    throw Error("groups are nested more than " + std::to_string(kMaxNesting) +
                " deep; flatten some");
  known = kInProgress;
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
  return both < kMaxSteps / 2 ? both : std::max(a, b);
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
      // Code that uses only one transform of a moving instance uses its transform at mid-shutter.
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

void SceneBuilder::warn_of_absorbing_graphs(const PlacedObjects& objects, bool in_glass) {
  const Glasses by_graph =
      glasses_of(materials_, [&](const Material& m) { return absorbs_by_graph(m, graphs_); });
  const auto first = std::ranges::find(by_graph, true);
  if (first == by_graph.end()) return;
  const Material& glass = materials_[static_cast<size_t>(first - by_graph.begin())];
  const char* const advice =
      "; absorption that a graph or texture drives acts where paths leave glass; use a constant "
      "transmission color";
  if (std::ranges::any_of(
          materials_, [&](const Material& m) { return needs_medium_stack(m, graphs_, in_glass); }))
    warnings_.push_back(quoted("material", glass.name) +
                        " does not absorb, since the stage has media or objects inside of meshes" +
                        advice);
  else if (glass_holds_lights(by_graph, objects, lights_) || glass_holds_objects(by_graph, objects))
    warnings_.push_back(quoted("material", glass.name) +
                        " does not dim light on its way to objects or from lights inside of it" +
                        advice);
}

void SceneBuilder::flatten_groups(SceneGeometry& geometry) {
  // Count instances before flattening: n nested groups can have 2^n placements, and most of these
  // placements may be empty.
  std::vector<uint64_t> placements(groups_.size(), kUncounted);
  std::vector<Instance> flat;
  flat.reserve(count_placements(0, 0, placements));
  flatten(0, {0, Affine{}, kInheritMaterial, kNoName, {}}, {}, placements, flat, geometry);
  geometry.placements.shrink_to_fit();
  const size_t singular = std::erase_if(flat, [&](const Instance& i) {
    bool valid = i.motion.moves() || is_invertible(i.to_world);
    for (uint32_t k = 0; i.motion.moves() && k <= i.motion.segments; ++k)
      valid = valid && is_invertible(geometry.steps[i.motion.first + k].affine());
    return !valid;
  });
  geometry.instances = std::move(flat);
  if (singular > 0)
    warnings_.push_back(std::to_string(singular) +
                        " instances have a singular transform and were left out");

  SceneCounts counts{.meshes = meshes_.size(),
                     .materials = materials_.size() + 2 + volumes_.size(),
                     .instances = geometry.instances.size(),
                     .instanced_meshes = groups_[0].meshes.size(),
                     .placements = geometry.placements.size(),
                     .steps = geometry.steps.size()};
  for (const Group& group : groups_) counts.grouped += group.meshes.size();
  for (const Instance& i : geometry.instances)
    counts.instanced_meshes += groups_[i.group].meshes.size();
  check_counts(counts);
}

uint32_t SceneBuilder::add_implicit_materials(SceneGeometry& geometry) {
  // A grey material for meshes without a material binding.
  const auto grey = static_cast<uint32_t>(materials_.size());
  Material fallback;
  fallback.name = "default";
  fallback.program = ProgramId::kDiffuse;
  fallback.base_color = {0.5f, 0.5f, 0.5f};
  materials_.push_back(fallback);
  // One material for the collisions in each volume.
  geometry.first_volume_material = grey + 1;
  for (const Volume& volume : volumes_) {
    Material inside;
    inside.name = volume.name;
    inside.program = ProgramId::kVolume;
    materials_.push_back(inside);
  }
  // A material for the exit points of subsurface random walks.
  if (std::ranges::any_of(materials_, [](const Material& m) {
        const Vec3<float>& r = m.openpbr.subsurface_radius;
        return has_trait(m.program, program_trait::kSubsurface) && std::max({r.x, r.y, r.z}) > 0;
      })) {
    geometry.exit_material = static_cast<uint32_t>(materials_.size());
    Material white = fallback;
    white.name = "below surfaces";
    white.base_color = {1, 1, 1};
    materials_.push_back(white);
  }
  return grey;
}

bool SceneBuilder::search_glass(const SceneGeometry& geometry) {
  const PlacedObjects objects{meshes_, groups_, geometry.instances, geometry.steps};
  const Glasses absorbing =
      glasses_of(materials_, [&](const Material& m) { return is_absorbing_solid(m, graphs_); });
  const bool in_glass = !volumes_.empty() || glass_holds_lights(absorbing, objects, lights_) ||
                        glass_holds_objects(absorbing, objects);
  warn_of_absorbing_graphs(objects, in_glass);
  return in_glass;
}

void SceneBuilder::bind_materials(SceneGeometry& geometry, uint32_t grey) const {
  for (const Mesh& mesh : meshes_) {
    const auto bad = [&](uint32_t m) { return m != kInheritMaterial && m >= grey; };
    if (bad(mesh.material) ||
        std::any_of(mesh.face_materials.begin(), mesh.face_materials.end(), bad))
      throw Error(quoted("mesh", mesh.name) + " uses a material that was never added");
  }
  for (Instance& i : geometry.instances) {
    if (i.material == kInheritMaterial) i.material = grey;
    if (i.material > grey) throw Error("an instance uses a material that was never added");
  }
}

void SceneBuilder::move_parts(SceneGeometry& geometry) {
  // Frees the nesting of groups, which is no longer needed.
  children_ = {};
  node_steps_ = {};
  geometry.meshes = std::move(meshes_);
  geometry.groups = std::move(groups_);
  geometry.textures = std::move(textures_);
  geometry.profiles = std::move(profiles_);
  geometry.filters = std::move(filters_);
  geometry.sets = std::move(sets_);
  geometry.visibility = std::move(visibility_);
  geometry.mesh_lights = std::move(mesh_lights_);
  geometry.volumes = std::move(volumes_);
  geometry.light_groups = std::move(light_groups_);
  geometry.attribute_names = std::move(attribute_names_);
  geometry.names = std::move(names_);
  geometry.warnings = std::move(warnings_);
}

std::shared_ptr<const Scene> SceneBuilder::build() {
  auto geometry = std::make_shared<SceneGeometry>();
  flatten_groups(*geometry);
  const uint32_t grey = add_implicit_materials(*geometry);
  const bool in_glass = search_glass(*geometry);
  bind_materials(*geometry, grey);
  move_parts(*geometry);
  std::shared_ptr<const SceneMaterials> materials;
  std::shared_ptr<const SceneLights> lights;
  std::shared_ptr<const SceneTangents> tangents;
  with_threads(threads_, [&] {
    make_records(*geometry, grey);
    materials = std::make_shared<const SceneMaterials>(
        std::move(materials_), std::make_shared<const GraphSet>(std::exchange(graphs_, {})),
        geometry->textures, geometry->exit_material, in_glass);
    lights =
        std::make_shared<const SceneLights>(std::move(lights_), *geometry, *materials, nullptr);
    tangents = std::make_shared<const SceneTangents>(*geometry, *materials, nullptr);
  });
  std::shared_ptr<Scene> scene(new Scene(std::move(geometry), std::move(materials),
                                         std::move(lights), std::move(tangents), nullptr, camera_));
  scene->link();
  *this = SceneBuilder(threads_, store_);
  return scene;
}

}  // namespace wavecomb
