// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/scene/moves.h"

#include <algorithm>

#include "wavecomb/core/error.h"
#include "wavecomb/scene/names.h"
#include "wavecomb/scene/object_bounds.h"
#include "wavecomb/scene/scene_checks.h"

namespace wavecomb {
namespace {

/// Moves that apply to an object, as indices into Moves.
using Matches = std::vector<uint32_t>;

/// Finds the moves of objects by name.
class MoveFinder {
 public:
  explicit MoveFinder(const Moves& moves) : moves_(moves), found_(moves.size(), false) {
    for (const auto& [path, m] : moves)
      if (!is_invertible(m))
        throw Error(quoted("prim", path) +
                    " is moved by a singular transform; give an invertible matrix");
  }

  Matches matches(std::string_view object) {
    Matches out;
    uint32_t i = 0;
    for (const auto& [path, m] : moves_) {
      if (is_in_prim(object, path)) {
        out.push_back(i);
        found_[i] = true;
      }
      ++i;
    }
    return out;
  }

  Affine transform(const Matches& matches) const {
    Affine product;
    uint32_t i = 0;
    for (const auto& [path, m] : moves_)
      if (std::ranges::binary_search(matches, i++)) product = product * m;
    return product;
  }

  /// Throws Error if a move applies to no object.
  void check_all_found() const {
    uint32_t i = 0;
    for (const auto& [path, m] : moves_)
      if (!found_[i++])
        throw Error("no object or light is at or below " + quoted("prim", path) +
                    "; give the path of a prim that is rendered");
  }

 private:
  const Moves& moves_;
  std::vector<bool> found_;
};

/// Puts the meshes of the world into groups and instances the groups. Meshes to which the same
/// moves apply are in the same group. The meshes of the world that do not move form a group as
/// well.
void instance_world(SceneGeometry& geometry, const ObjectNames& names, MoveFinder& finder) {
  std::map<Matches, std::vector<uint32_t>> by_moves;
  uint32_t object = 0;
  for (const uint32_t mesh : geometry.groups[0].meshes)
    by_moves[finder.matches(names.object(object++))].push_back(mesh);
  const uint32_t material = geometry.instance_records[0].material;
  for (auto& [matches, meshes] : by_moves) {
    Instance instance;
    instance.group = static_cast<uint32_t>(geometry.groups.size());
    instance.to_world = finder.transform(matches);
    instance.material = material;
    geometry.groups.push_back({"", std::move(meshes), ""});
    geometry.instances.push_back(instance);
  }
  geometry.groups[0].meshes.clear();
}

/// Returns the moves of an instance, which apply to all its meshes. `object` is the first object of
/// the instance.
Matches moves_of_instance(const SceneGeometry& geometry, const Instance& instance, uint32_t object,
                          const ObjectNames& names, MoveFinder& finder) {
  const size_t count = geometry.groups[instance.group].meshes.size();
  Matches all;
  for (size_t k = 0; k < count; ++k) {
    const std::string name = names.object(object + static_cast<uint32_t>(k));
    Matches one = finder.matches(name);
    if (k > 0 && one != all)
      throw Error(quoted("object", name) +
                  " is a part of an instance, which can only be moved as a whole");
    all = std::move(one);
  }
  return all;
}

}  // namespace

Affine move_of(const Moves& moves, std::string_view object) {
  Affine product;
  for (const auto& [path, m] : moves)
    if (is_in_prim(object, path)) product = product * m;
  return product;
}

std::shared_ptr<const SceneGeometry> moved_geometry(const Scene& unmoved, const Moves& moves) {
  auto geometry = std::make_shared<SceneGeometry>(*unmoved.geometry());
  const ObjectNames names(unmoved);
  MoveFinder finder(moves);
  const size_t placed = geometry->instances.size();
  for (size_t i = 0; i < placed; ++i) {
    Instance& instance = geometry->instances[i];
    const Affine m = finder.transform(
        moves_of_instance(*geometry, instance, names.first_object()[i + 1], names, finder));
    instance.to_world = m * instance.to_world;
    for (uint32_t k = 0; instance.motion.moves() && k <= instance.motion.segments; ++k) {
      MatrixStep& step = geometry->steps[instance.motion.first + k];
      step = MatrixStep(m * step.affine());
    }
  }
  instance_world(*geometry, names, finder);
  for (const Volume& volume : geometry->volumes)
    if (!finder.matches(volume.name).empty())
      throw Error(quoted("volume", volume.name) + " cannot be moved; load the stage again");
  for (const Light& light : unmoved.lights()) finder.matches(light.name);
  finder.check_all_found();
  place_instances(*geometry);
  return geometry;
}

}  // namespace wavecomb
