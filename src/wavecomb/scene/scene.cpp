// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/scene/scene.h"

#include <algorithm>
#include <set>
#include <utility>

#include "wavecomb/core/error.h"
#include "wavecomb/light/description/light_table.h"
#include "wavecomb/medium/description/glass_contents.h"
#include "wavecomb/medium/description/mesh_medium.h"
#include "wavecomb/medium/description/volume_motion.h"
#include "wavecomb/scene/camera/camera_table.h"
#include "wavecomb/scene/moves.h"
#include "wavecomb/scene/object_bounds.h"
#include "wavecomb/scene/parallel.h"
#include "wavecomb/scene/scene_checks.h"
#include "wavecomb/texture/tile_store.h"

namespace wavecomb {
namespace {

bool same(const Vec3<float>& a, const Vec3<float>& b) {
  return a.x == b.x && a.y == b.y && a.z == b.z;
}

bool same(const TextureUse& a, const TextureUse& b) {
  return a.texture == b.texture && a.channel == b.channel && a.scale == b.scale &&
         a.bias == b.bias && a.uv == b.uv;
}
bool same_texture(const Material& a, const Material& b, Input input) {
  const auto s = static_cast<size_t>(input);
  return same(a.textures[s], b.textures[s]);
}

/// Returns whether two materials give a surface the same presence.
bool same_presence(const Material& a, const Material& b) {
  if (!a.needs_presence() && !b.needs_presence()) return true;
  return a.needs_presence() == b.needs_presence() && a.opacity == b.opacity &&
         a.opacity_threshold == b.opacity_threshold && a.opacity_graph == b.opacity_graph &&
         same_texture(a, b, Input::kOpacity);
}

/// Returns whether two materials give a surface the same emission. If the scene has mesh lights
/// (`any_mesh_lights`), materials without emission must also agree in presence, since a mesh light
/// emits only where its mesh is present.
bool same_emission(const Material& a, const Material& b, bool any_mesh_lights) {
  if (a.emits() != b.emits()) return false;
  if (!a.emits()) return !any_mesh_lights || same_presence(a, b);
  return same(a.emission, b.emission) && a.emission_graph == b.emission_graph &&
         same_texture(a, b, Input::kEmission) && same_presence(a, b);
}

[[noreturn]] void throw_unknown(const char* kind, uint32_t id, size_t count) {
  throw Error(std::string(kind) + " " + std::to_string(id) + " is not there; the scene has " +
              std::to_string(count));
}

}  // namespace

Scene::Scene(std::shared_ptr<const SceneGeometry> geometry,
             std::shared_ptr<const SceneMaterials> materials,
             std::shared_ptr<const SceneLights> lights,
             std::shared_ptr<const SceneTangents> tangents, std::shared_ptr<const SceneLinks> links,
             const Camera& camera)
    : geometry_(std::move(geometry)),
      materials_(std::move(materials)),
      lights_(std::move(lights)),
      tangents_(std::move(tangents)),
      links_(std::move(links)),
      camera_(camera) {
  SceneView& v = view_;
  v.meshes = geometry_->mesh_records.data();
  v.instances = geometry_->instance_records.data();
  v.tangents = tangents_->records.empty() ? nullptr : tangents_->records.data();
  v.geometry_mesh = geometry_->geometry_mesh.data();
  v.emissive_lights = lights_->emissive.data();
  v.mesh_lights = lights_->mesh_lights.empty() ? nullptr : lights_->mesh_lights.data();
  v.material_program = materials_->programs.data();
  v.material_variant = materials_->variants.data();
  v.materials.materials = materials_->records.data();
  v.materials.uses = materials_->uses.data();
  v.materials.textures = geometry_->texture_views.data();
  v.materials.openpbr = materials_->openpbr.data();
  v.materials.own = materials_->own.data();
  if (!materials_->straight_table.empty()) {
    v.materials.straight_table = materials_->straight_table.data();
    v.materials.straight_tables = materials_->straight_tables.data();
  }
  v.materials.graphs = materials_->graphs->view();
  v.materials.graphs.attributes = geometry_->attributes();
  v.lights = lights_->set.view(v.materials);
  v.lights.meshes = v.meshes;
  v.lights.instances = v.instances;
  v.scale = geometry_->radius;
  v.motion = {geometry_->mesh_motions.data(),
              geometry_->instance_motions.empty() ? nullptr : geometry_->instance_motions.data(),
              geometry_->steps.data()};
  v.volumes = {geometry_->volume_records.data(),
               static_cast<uint32_t>(geometry_->volume_records.size()),
               geometry_->first_volume_material,
               std::ranges::any_of(geometry_->volume_records, &VolumeRecord::emits)};
  v.subsurface = {materials_->walks.empty() ? nullptr : materials_->walks.data(),
                  geometry_->exit_material};
  v.nested_media = {materials_->nested_media.empty() ? nullptr : materials_->nested_media.data(),
                    materials_->event_material};
  v.has_motion = geometry_->moves() || v.lights.motions;
  v.has_emissive_meshes = !lights_->emissive.empty();
  v.has_curves = std::any_of(meshes().begin(), meshes().end(),
                             [](const Mesh& mesh) { return mesh.is_curved(); });
  v.has_presence = materials_->has_presence || splats() > 0;
  if (links_) v.lights.links = links_->view();
}

void Scene::link() {
  if (geometry_->sets.empty() && geometry_->visibility.empty()) return;
  const ObjectNames names(*this);
  if (!geometry_->sets.empty()) {
    links_ = std::make_shared<const SceneLinks>(names, geometry_->sets);
    view_.lights.links = links_->view();
  }
  std::vector<uint32_t> visibility = object_visibility(*this, names);
  if (visibility.empty()) return;
  // Bounce rays must be able to hit emitters that are sampled as lights, since the MIS weights
  // assume that bounce rays can hit them.
  for (size_t i = 0; i < lights_->emissive.size(); ++i)
    if (lights_->emissive[i] != kNoLight) visibility[i] |= kVisibleToBounces;
  visibility_ = std::make_shared<const std::vector<uint32_t>>(std::move(visibility));
  view_.visibility = visibility_->data();
}

bool Scene::needs_in_glass(const SceneGeometry& geometry, std::span<const Material> all_materials,
                           std::span<const Light> all_lights) const {
  if (!volumes().empty()) return true;
  const auto test = [&](const Material& m) { return is_absorbing_solid(m, *materials_->graphs); };
  const Glasses before = glasses_of(materials(), test), after = glasses_of(all_materials, test);
  // The current materials of the scene may end with an internal material for collisions inside
  // meshes; the new materials do not contain this material.
  const bool same_glass =
      &geometry == geometry_.get() && std::equal(after.begin(), after.end(), before.begin());
  const bool same_lights =
      std::ranges::equal(lights(), all_lights, [](const Light& a, const Light& b) {
        return a.kind == b.kind && same(a.to_world.t, b.to_world.t);
      });
  if (same_glass && same_lights) return materials_->in_glass;
  const PlacedObjects objects{geometry.meshes, geometry.groups, geometry.instances, geometry.steps};
  if (glass_holds_lights(after, objects, all_lights)) return true;
  if (same_glass && !materials_->in_glass) return false;
  return glass_holds_objects(after, objects);
}

void Scene::check(const SceneEdit& edit) const {
  if (edit.camera) check_camera(*edit.camera);
  for (const auto& [id, material] : edit.materials) {
    if (id >= materials().size()) throw_unknown("material", id, materials().size());
    check_material(material, textures().size(), materials_->graphs->programs.size());
    for (const ProgramId program : {material.program, materials()[id].program})
      if (static_cast<uint32_t>(program) >= kSurfaceProgramCount)
        throw Error(quoted("material", material.name) +
                    " is the internal material of a medium; it cannot be edited");
  }
  for (const auto& [i, light] : edit.lights) {
    if (i >= lights().size()) throw_unknown("light", i, lights().size());
    check_light(light, {textures().size(), geometry_->profiles.size(), geometry_->sets.size(),
                        geometry_->filters.size()});
    if (light.group >= light_groups().size())
      throw_unknown("light group", light.group, light_groups().size());
  }
}

std::vector<Light> Scene::edited_lights(const SceneEdit& edit, const Moves& moves) const {
  std::vector<Light> all = lights();
  if (!edit.moves.empty()) {
    const std::vector<Light>& placed = (unmoved_ ? *unmoved_ : *this).lights();
    for (size_t i = 0; i < all.size(); ++i) {
      const auto moves_light = [&](const auto& one) { return is_in_prim(all[i].name, one.first); };
      if (std::ranges::none_of(edit.moves, moves_light)) continue;
      const Affine m = move_of(moves, all[i].name);
      all[i].to_world = m * placed[i].to_world;
      for (size_t k = 0; k < all[i].motion.size(); ++k) all[i].motion[k] = m * placed[i].motion[k];
    }
  }
  for (const auto& [i, light] : edit.lights) all[i] = light;
  return all;
}

std::shared_ptr<const Scene> Scene::edited(const SceneEdit& edit, uint32_t threads) const {
  check(edit);
  const bool is_moved = !edit.moves.empty();
  Moves moves = moves_;
  for (const auto& [path, m] : edit.moves) moves.insert_or_assign(path, m);
  std::shared_ptr<const SceneGeometry> new_geometry = geometry_;
  if (is_moved) new_geometry = moved_geometry(unmoved_ ? *unmoved_ : *this, moves);

  std::shared_ptr<const SceneMaterials> new_materials = materials_;
  bool emission_changed = !edit.lights.empty() || is_moved;
  std::vector<Light> all_lights;
  if (!edit.materials.empty() || emission_changed) {
    all_lights = edited_lights(edit, moves);
    const bool any_mesh_lights = !geometry_->mesh_lights.empty();
    std::vector<Material> all = materials_->given();
    for (const auto& [id, material] : edit.materials) {
      emission_changed = emission_changed || !same_emission(all[id], material, any_mesh_lights);
      all[id] = material;
    }
    const bool in_glass = needs_in_glass(*new_geometry, all, all_lights);
    if (!edit.materials.empty() || in_glass != materials_->in_glass)
      new_materials = std::make_shared<const SceneMaterials>(std::move(all), materials_->graphs,
                                                             geometry_->textures,
                                                             geometry_->exit_material, in_glass);
  }
  std::shared_ptr<const SceneTangents> new_tangents = tangents_;
  if (new_materials->wants_tangents != materials_->wants_tangents)
    with_threads(threads, [&] {
      new_tangents =
          std::make_shared<const SceneTangents>(*geometry_, *new_materials, tangents_.get());
    });
  std::shared_ptr<const SceneLights> new_lights = lights_;
  if (emission_changed)
    with_threads(threads, [&] {
      new_lights = std::make_shared<const SceneLights>(std::move(all_lights), *new_geometry,
                                                       *new_materials, lights_.get());
    });
  std::shared_ptr<Scene> scene(new Scene(std::move(new_geometry), std::move(new_materials),
                                         std::move(new_lights), std::move(new_tangents), links_,
                                         edit.camera.value_or(camera_)));
  scene->visibility_ = visibility_;
  scene->view_.visibility = view_.visibility;
  scene->unmoved_ = is_moved && !unmoved_ ? shared_from_this() : unmoved_;
  scene->moves_ = std::move(moves);
  if (is_moved) scene->link();
  return scene;
}

uint64_t Scene::unique_triangles() const {
  uint64_t n = 0;
  for (const Mesh& mesh : meshes()) n += mesh.triangle_count();
  return n;
}

uint64_t Scene::curve_segments() const {
  uint64_t n = 0;
  for (const Mesh& mesh : meshes())
    if (mesh.is_strands()) n += mesh.primitive_count();
  return n;
}

uint64_t Scene::points() const {
  uint64_t n = 0;
  for (const Mesh& mesh : meshes())
    if (mesh.primitive == Primitive::kSphere) n += mesh.primitive_count();
  return n;
}

uint64_t Scene::splats() const {
  uint64_t n = 0;
  for (const Mesh& mesh : meshes()) n += mesh.splats.size();
  return n;
}

const TileStore* Scene::texture_store() const {
  for (const auto& texture : textures())
    if (texture->store()) return texture->store().get();
  return nullptr;
}

SceneBytes Scene::bytes() const {
  SceneBytes b;
  for (const Mesh& m : meshes())
    b.meshes += m.positions.size_bytes() + m.indices.size_bytes() + m.normals.size_bytes() +
                m.uvs.size_bytes() + m.face_materials.size_bytes() + m.radii.size_bytes() +
                m.splats.size_bytes() + m.harmonics.size_bytes();
  for (const Mesh& m : meshes())
    for (const MeshAttribute& a : m.attributes) b.meshes += a.values.size_bytes();
  b.meshes += tangents_->bytes();
  for (const auto& texture : textures())
    if (!texture->store()) b.textures += texture->bytes();
  if (const TileStore* store = texture_store()) b.textures += store->statistics().resident_bytes;
  const auto of = [](const auto&... v) { return ((v.size() * sizeof(v[0])) + ...); };
  const SceneGeometry& g = *geometry_;
  const LightSet& set = lights_->set;
  b.records =
      of(g.meshes, g.face_materials, g.instances, g.mesh_records, g.instance_records,
         g.geometry_mesh, g.texture_views, g.placements, g.mesh_motions, g.steps,
         g.instance_motions, g.attribute_records, g.mesh_attributes) +
      of(materials_->materials, materials_->shaded, materials_->records, materials_->uses,
         materials_->programs, materials_->openpbr, materials_->graphs->programs,
         materials_->graphs->ops, materials_->graphs->constants, materials_->graphs->images,
         materials_->graphs->outputs) +
      of(lights_->emissive, lights_->mesh_lights, set.mesh_lights, set.records, set.triangles,
         set.triangle_uvs, set.power_bins, set.powers, set.portals, set.portal_groups, set.shapings,
         set.ies, set.ies_numbers, set.filters, set.shadows, set.motions, set.motion_steps) +
      lights_->tree_bytes() + g.names.bytes();
  std::set<const void*> grids;
  for (const Volume& volume : g.volumes) {
    if (volume.motion && grids.insert(volume.motion.get()).second)
      b.volumes += volume.motion->bytes();
    for (const VolumeField* field :
         {&volume.density, &volume.color, &volume.glow, &volume.velocity})
      if (field->grid && grids.insert(field->grid.get()).second) b.volumes += field->grid->bytes();
  }
  for (const Distribution2D& d : set.distributions) b.records += of(d.cumulative, d.coarse);
  return b;
}

uint64_t Scene::instanced_triangles() const {
  std::vector<uint64_t> of_group(groups().size(), 0);
  for (size_t g = 0; g < groups().size(); ++g)
    for (uint32_t mesh : groups()[g].meshes) of_group[g] += meshes()[mesh].triangle_count();
  uint64_t n = of_group[0];
  for (const Instance& i : instances()) n += of_group[i.group];
  return n;
}

}  // namespace wavecomb
