// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/scene/object_bounds.h"

#include <unordered_map>

#include "wavecomb/scene/names.h"

namespace wavecomb {

bool is_in_prim(std::string_view object, std::string_view prim) {
  if (!object.starts_with(prim)) return false;
  return object.size() == prim.size() || object[prim.size()] == '/' || object[prim.size()] == '[';
}

Bounds mesh_bounds(const Mesh& mesh) {
  Bounds out;
  const auto& p = mesh.positions;
  for (size_t i = 0; i + 2 < p.size(); i += 3) {
    const float r = mesh.radii.empty() ? 0.f : mesh.radii[i / 3 % mesh.radii.size()];
    out.add({p[i] - r, p[i + 1] - r, p[i + 2] - r});
    out.add({p[i] + r, p[i + 1] + r, p[i + 2] + r});
  }
  return out;
}

void add_instance_bounds(Bounds& out, const Bounds& box, const Instance& instance,
                         std::span<const MatrixStep> steps) {
  if (box.empty()) return;
  const auto add_box = [&](const Affine& to_world) {
    for (int corner = 0; corner < 8; ++corner)
      out.add(to_world.point({corner & 1 ? box.hi.x : box.lo.x, corner & 2 ? box.hi.y : box.lo.y,
                              corner & 4 ? box.hi.z : box.lo.z}));
  };
  if (!instance.motion.moves()) add_box(instance.to_world);
  for (uint32_t k = 0; instance.motion.moves() && k <= instance.motion.segments; ++k)
    add_box(steps[instance.motion.first + k].affine());
}

Bounds object_bounds(const Scene& scene, std::string_view prim) {
  const ObjectNames names(scene);
  std::unordered_map<uint32_t, Bounds> known;
  const auto bounds_of = [&](uint32_t mesh) -> const Bounds& {
    const auto [at, is_new] = known.try_emplace(mesh);
    if (is_new) at->second = mesh_bounds(scene.meshes()[mesh]);
    return at->second;
  };
  Bounds out;
  uint32_t object = 0;
  for (uint32_t mesh : scene.groups()[0].meshes)
    if (is_in_prim(names.object(object++), prim)) out.add(bounds_of(mesh));
  for (const Instance& instance : scene.instances())
    for (uint32_t mesh : scene.groups()[instance.group].meshes)
      if (is_in_prim(names.object(object++), prim))
        add_instance_bounds(out, bounds_of(mesh), instance, scene.geometry()->steps);
  return out;
}

}  // namespace wavecomb
