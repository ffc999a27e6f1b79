// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/scene/names.h"

#include <algorithm>

#include "wavecomb/core/error.h"
#include "wavecomb/scene/scene.h"

namespace wavecomb {
namespace {

/// Returns the part of `path` after the root path of a group.
std::string_view below(std::string_view path, std::string_view root) {
  const size_t n = root.size();
  if (n > 0 && path.starts_with(root) && (path.size() == n || path[n] == '/'))
    path.remove_prefix(n);
  return path;
}

/// Returns `path` as seen through a placement called `outer` of a group with root `root`.
std::string path_through(std::string outer, std::string_view root, std::string_view path) {
  outer += below(path, root);
  return outer;
}

/// Returns `name` followed by "[number]".
std::string numbered(std::string name, uint32_t number) {
  name += '[';
  name += std::to_string(number);
  name += ']';
  return name;
}

/// Returns the prim below the stage's root prim: "/World/Box" for "/World/Box/Lid".
std::string second_level(const std::string& path) {
  const size_t first = path.find('/', 1);
  if (first == std::string::npos) return path;
  return path.substr(0, path.find('/', first + 1));
}

}  // namespace

uint32_t NameTable::add(std::string_view text, uint32_t asset_length) {
  entries_.push_back({chars_.size(), static_cast<uint32_t>(text.size()), asset_length});
  chars_ += text;
  return static_cast<uint32_t>(entries_.size() - 1);
}

ObjectNames::ObjectNames(const Scene& scene) : scene_(scene) {
  uint64_t next = 0;
  const auto add = [&](uint32_t group) {
    first_object_.push_back(static_cast<uint32_t>(next));
    next += scene.groups()[group].meshes.size();
  };
  first_object_.reserve(1 + scene.instances().size());
  add(0);
  for (const Instance& instance : scene.instances()) add(instance.group);
  const LightSet& set = scene.light_set();
  light_count_ = set.first_triangle();
  volume_count_ = static_cast<uint32_t>(scene.volumes().size());
  if (next + light_count_ + volume_count_ >= kNoName)
    throw Error(
        "the scene has more than 4,294,967,294 objects, the limit of object ids; use fewer "
        "instances");
  first_light_ = static_cast<uint32_t>(next);
  light_of_record_.resize(light_count_);
  for (size_t i = 0; i < scene.lights().size(); ++i)
    light_of_record_[set.of_input[i]] = static_cast<uint32_t>(i);
}

ObjectNames::Found ObjectNames::find(uint32_t index) const {
  // An instance without meshes has the same first object as the next instance, so take the last
  // such instance.
  const auto next = std::upper_bound(first_object_.begin(), first_object_.end(), index);
  const auto instance = static_cast<uint32_t>(next - first_object_.begin() - 1);
  const uint32_t group = instance == 0 ? 0 : scene_.instances()[instance - 1].group;
  return {instance, scene_.groups()[group].meshes[index - first_object_[instance]]};
}

std::string ObjectNames::placement_name(uint32_t placement) const {
  if (placement == kNoName) return {};
  const Placement& p = scene_.placements()[placement];
  const std::string outer = placement_name(p.parent);
  if (p.name == kNoName) return numbered(outer, placement);
  std::string name = path_through(outer, parent_root(p), scene_.names()[p.name].text);
  return p.number == kNoName ? name : numbered(std::move(name), p.number);
}

std::string_view ObjectNames::parent_root(const Placement& p) const {
  if (p.parent == kNoName) return {};
  return scene_.groups()[scene_.placements()[p.parent].group].root;
}

std::string ObjectNames::object(uint32_t index) const {
  if (index >= first_volume()) return scene_.volumes()[index - first_volume()].name;
  if (index >= first_light_) return scene_.lights()[light_of_record_[index - first_light_]].name;
  const Found found = find(index);
  const std::string& mesh = scene_.meshes()[found.mesh].name;
  if (found.instance == 0) return mesh;
  const Instance& instance = scene_.instances()[found.instance - 1];
  return path_through(placement_name(instance.placement), scene_.groups()[instance.group].root,
                      mesh);
}

std::string ObjectNames::asset(uint32_t index) const {
  if (index >= first_light_) return second_level(object(index));
  const Found found = find(index);
  const Mesh& mesh = scene_.meshes()[found.mesh];
  const std::string_view model = std::string_view(mesh.name).substr(0, mesh.asset_length);
  const bool in_world =
      found.instance == 0 || scene_.instances()[found.instance - 1].placement == kNoName;
  if (in_world) return model.empty() ? second_level(mesh.name) : std::string(model);
  const Instance& instance = scene_.instances()[found.instance - 1];
  if (!model.empty())
    return path_through(placement_name(instance.placement), scene_.groups()[instance.group].root,
                        model);
  uint32_t outermost = instance.placement;
  for (uint32_t p = instance.placement; p != kNoName; p = scene_.placements()[p].parent) {
    outermost = p;
    const Placement& placement = scene_.placements()[p];
    if (placement.name == kNoName) continue;
    const PlacementName name = scene_.names()[placement.name];
    if (name.asset_length == 0) continue;
    // If the name of the asset is the name of a placement with several instances, each of these
    // instances is an asset.
    if (name.asset_length == name.text.size()) return placement_name(p);
    return path_through(placement_name(placement.parent), parent_root(placement),
                        name.text.substr(0, name.asset_length));
  }
  return placement_name(outermost);
}

}  // namespace wavecomb
