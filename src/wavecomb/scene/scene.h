// SPDX-License-Identifier: Apache-2.0
/// An immutable scene, and the builder that is the only way to make one.
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <unordered_map>
#include <vector>

#include "wavecomb/scene/camera.h"
#include "wavecomb/scene/interior.h"
#include "wavecomb/scene/mesh_tangents.h"
#include "wavecomb/scene/scene_parts.h"
#include "wavecomb/scene/visibility.h"
#include "wavecomb/scene/volume.h"
#include "wavecomb/scene/walk_data.h"

namespace wavecomb {

/// What kernels need of a scene: plain pointers, valid as long as the Scene.
struct SceneView {
  const MeshRecord* meshes = nullptr;
  const InstanceRecord* instances = nullptr;
  const TangentRecord* tangents = nullptr;  ///< by mesh; null where no mesh has any
  const uint32_t* geometry_mesh = nullptr;  ///< mesh of (instance.geometry + geometry id)
  /// First triangle light of (instance.emissive + geometry id).
  const uint32_t* emissive_lights = nullptr;
  /// Likewise the record of a mesh light, or kNoLight. Null where there are no mesh lights.
  const uint32_t* mesh_lights = nullptr;
  /// Likewise RayVisibility. Null where all rays see everything.
  const uint32_t* visibility = nullptr;
  const uint32_t* material_program = nullptr;
  const uint32_t* material_variant = nullptr;  ///< material_parts.h
  MaterialView materials;
  LightView lights;
  MotionView motion;
  VolumeView volumes;
  WalkView walks;
  InteriorView interiors;
  float scale = 1;  ///< radius of the bounding sphere
  bool has_presence = false;
  bool has_emissive_meshes = false;
  bool has_curves = false;  ///< curves or points
  bool has_motion = false;  ///< some mesh, instance or light moves while the shutter is open
};

/// Memory of a scene's arrays, bytes.
struct SceneBytes {
  /// Points, indices, radii, normals, tangents, texture coordinates, attributes, materials of
  /// faces.
  uint64_t meshes = 0;
  uint64_t textures = 0;  ///< all mip levels, or what of them a store has in memory
  uint64_t records = 0;   ///< instances, materials, lights
  uint64_t volumes = 0;   ///< grids
};

/// What is to be other in a scene: values that take the place of those there.
struct SceneEdit {
  std::optional<Camera> camera{};
  std::map<uint32_t, Material> materials{};  ///< by id
  std::map<uint32_t, Light> lights{};        ///< by index into Scene::lights
};

class SceneBuilder;
struct PlacedObjects;

/// Geometry, materials, textures, lights and camera, checked and complete. Immutable; any number of
/// renderers and threads may read it.
class Scene {
 public:
  Scene(const Scene&) = delete;
  Scene& operator=(const Scene&) = delete;

  SceneView view() const { return view_; }
  const std::vector<Mesh>& meshes() const { return geometry_->meshes; }
  /// Group 0 is the world: its meshes are in world space and not instanced.
  const std::vector<Group>& groups() const { return geometry_->groups; }
  /// Flattened: every entry places a group of meshes (never group 0) in the world.
  const std::vector<Instance>& instances() const { return geometry_->instances; }
  const std::vector<Material>& materials() const { return materials_->materials; }
  const std::vector<TexturePtr>& textures() const { return geometry_->textures; }
  /// What keeps the textures within a limit: of the first that has a store; null: none has.
  const TileStore* texture_store() const;
  const std::vector<Light>& lights() const { return lights_->lights; }
  const std::vector<Volume>& volumes() const { return geometry_->volumes; }
  /// Names of light groups; the first is kOtherLights.
  const std::vector<std::string>& light_groups() const { return geometry_->light_groups; }
  /// Index into light_groups() of every light that kernels know, triangles last.
  std::vector<uint32_t> groups_of_lights() const;
  /// Of the same lights: 1 where one is the glow of an object's material, and no light of the
  /// stage.
  std::vector<uint8_t> lights_of_objects() const;
  /// The ways from the world to the instances, and the names on them.
  const std::vector<Placement>& placements() const { return geometry_->placements; }
  const NameTable& names() const { return geometry_->names; }
  const LightSet& light_set() const { return lights_->set; }
  /// The tree of lights with its nodes, which light_set() may have but an outline of; built on so
  /// many threads (0: all) where it is not yet. Any thread may ask.
  const LightTree& light_tree(uint32_t threads) const { return lights_->tree(threads); }
  const Camera& camera() const { return camera_; }
  const Bounds& bounds() const { return geometry_->bounds; }
  /// Triangles of all meshes, each counted once, and with every instance counted.
  uint64_t unique_triangles() const;
  uint64_t instanced_triangles() const;
  /// Segments of curves and points, each counted once.
  uint64_t curve_segments() const;
  uint64_t points() const;
  uint64_t splats() const;
  SceneBytes bytes() const;
  /// One line each: what was mended or left out while building (zero-area faces, NaN points ...).
  const std::vector<std::string>& warnings() const { return geometry_->warnings; }

  /// A scene with other values, which shares with this one what did not change; equal to one built
  /// anew with them. `threads`: 0: all.
  ///
  /// Costs microseconds for a camera, copies of the materials for a material, the light set where
  /// lights or emission change, and tangents of meshes whose material asks for them anew. A
  /// material that begins or ceases to absorb, or a light that moves, costs a search of what is
  /// inside of absorbing glass. Throws Error naming the object for bad values, as SceneBuilder
  /// does, and for ids that are not there.
  std::shared_ptr<const Scene> edited(const SceneEdit& edit, uint32_t threads = 0) const;

  /// The parts, to be compared with those of scenes that were made from one another.
  const std::shared_ptr<const SceneGeometry>& geometry() const { return geometry_; }
  const std::shared_ptr<const SceneMaterials>& material_part() const { return materials_; }
  const std::shared_ptr<const SceneLights>& light_part() const { return lights_; }

 private:
  friend class SceneBuilder;
  Scene(std::shared_ptr<const SceneGeometry> geometry,
        std::shared_ptr<const SceneMaterials> materials, std::shared_ptr<const SceneLights> lights,
        std::shared_ptr<const SceneTangents> tangents, std::shared_ptr<const SceneLinks> links,
        const Camera& camera);
  /// Works out which objects are in which sets, and which rays see them.
  void link();
  /// SceneMaterials::in_glass of a scene with this geometry and other materials and lights.
  bool needs_in_glass(std::span<const Material> materials, std::span<const Light> lights) const;
  /// A value for every light that kernels know: of_input(light) of the stage's, of_run(triangles)
  /// of those of meshes.
  template <typename T, typename OfInput, typename OfRun>
  std::vector<T> for_all_lights(const OfInput& of_input, const OfRun& of_run) const;

  std::shared_ptr<const SceneGeometry> geometry_;
  std::shared_ptr<const SceneMaterials> materials_;
  std::shared_ptr<const SceneLights> lights_;
  std::shared_ptr<const SceneTangents> tangents_;
  std::shared_ptr<const SceneLinks> links_;  ///< null where there are no sets
  /// SceneView::visibility; null where all rays see everything.
  std::shared_ptr<const std::vector<uint32_t>> visibility_;
  Camera camera_;
  SceneView view_;
};

/// Collects a scene. Ids are handed out from 0 in order of addition.
///
/// Contract: one thread at a time. Arrays of meshes stay the caller's and must live as long as the
/// Scene (Mesh::owner sees to it). Every function throws Error with one line that names the object.
class SceneBuilder {
 public:
  /// `threads`: for textures and for build(); 0: all. `store`: keeps the textures that are added
  /// here, with those of other scenes; null: they are in memory.
  explicit SceneBuilder(uint32_t threads = 0, std::shared_ptr<TileStore> store = nullptr);
  SceneBuilder(SceneBuilder&&) = default;
  SceneBuilder& operator=(SceneBuilder&&) = default;

  uint32_t add_texture(const TextureDesc& desc);
  /// A texture of another scene, which may end before this one.
  uint32_t add_texture(TexturePtr texture);
  /// A UDIM texture of textures that were added, by tile number from 1001 to 1100; `missing`:
  /// linear r, g, b, alpha where there is no tile.
  uint32_t add_tiles(const std::string& name,
                     const std::vector<std::pair<uint32_t, uint32_t>>& tiles,
                     const std::array<float, 4>& missing);
  /// A texture that was added; valid until the builder is gone or build() is called.
  const Texture& texture(uint32_t id) const;
  /// A program for Material::graph and its parts; outputs are numbered as in graph/parameters.h.
  /// Texture ids in it must exist.
  uint32_t add_graph(const Graph& graph);
  /// Texture and graph ids in the material must exist.
  uint32_t add_material(Material material);
  /// The id of an attribute of that name, for MeshAttribute and for graphs.
  uint32_t attribute(const std::string& name);
  /// Checks sizes, indices and radii. Faces with points that are not finite are refused by name;
  /// faces without area stay (they are never hit).
  uint32_t add_mesh(Mesh mesh);
  /// Gives a mesh other arrays, checked as those of add_mesh; its name, its light group and its
  /// place in groups stay.
  void replace_mesh(uint32_t id, Mesh mesh);
  /// A new empty group, to hold meshes and instances of other groups. Group 0, the world, is there.
  /// `root` is the prim path that names of its meshes and of placements in it begin with, which
  /// each of its own placements' names takes the place of (ObjectNames).
  uint32_t add_group(std::string name, std::string root = {});
  void add_to_group(uint32_t group, uint32_t mesh);
  /// Places `child` inside `parent`; nested to any depth without copies of geometry. `material` (or
  /// kInheritMaterial) goes to the meshes in it that have none of their own.
  /// `name` is of add_placement_name, `number` tells those of one name apart. `steps`: transforms
  /// at equal distances over the shutter, two or more where it moves; `transform` does not count
  /// then.
  void add_instance(uint32_t parent, uint32_t child, const Affine& transform,
                    uint32_t material = kInheritMaterial, uint32_t name = kNoName,
                    uint32_t number = kNoName, std::span<const Affine> steps = {});
  /// A name for instances; the first `asset_length` characters name the asset that they are part
  /// of, 0 where that is not known.
  uint32_t add_placement_name(std::string_view name, uint32_t asset_length);
  /// A set for Light::light_link and shadow_link.
  uint32_t add_geometry_set(GeometrySet set);
  /// Says which rays see a prim and what is below it. Of two rules for one path the later counts.
  void add_visibility(VisibilityRule rule);
  /// A profile for Shaping::ies.
  uint32_t add_ies(IesProfile profile);
  /// A filter for Light::filter.
  uint32_t add_light_filter(LightFilter filter);
  uint32_t add_light(Light light);
  /// A light for Mesh::mesh_light, of kind kMeshLight. If not `visible` it shines at any opacity.
  uint32_t add_mesh_light(Light light);
  /// The number of a light group, for Light::group and Mesh::light_group; "" is kOtherLights.
  uint32_t light_group(const std::string& name);
  /// A volume, which fills space in the world, whatever surfaces there are. Volumes may overlap.
  uint32_t add_volume(Volume volume);
  void set_camera(const Camera& camera);

  /// Checks everything that spans objects (cycles of groups, singular transforms, materials) and
  /// makes the scene. The builder is empty afterwards. Meshes without any material get a grey
  /// diffuse one.
  std::shared_ptr<const Scene> build();

 private:
  struct Node {
    uint32_t child;
    Affine transform;
    uint32_t material;
    uint32_t name, number;
    StepRange motion;  ///< of node_steps_
  };
  /// Instances of groups with meshes that one placement of `group` makes; finds cycles.
  uint64_t count_placements(uint32_t group, uint32_t depth, std::vector<uint64_t>& of_group) const;
  /// Places `group` and all that is in it. `steps`: of `here`, where it moves.
  void flatten(uint32_t group, const Instance& here, std::span<const Affine> steps,
               const std::vector<uint64_t>& counts, std::vector<Instance>& out,
               SceneGeometry& geometry) const;
  /// Transforms of a node within a group that moves as `outer` says or stands still at `still`;
  /// none where neither moves.
  std::vector<Affine> composed(std::span<const Affine> outer, const Affine& still,
                               const Node& node) const;
  /// Warns of glass whose absorption comes from a value graph, where that shows: in_glass
  /// (SceneMaterials), or with objects or lights inside of it.
  void warn_of_absorbing_graphs(const PlacedObjects& objects, bool in_glass);
  void make_records(SceneGeometry& geometry, uint32_t grey) const;

  uint32_t threads_;
  std::shared_ptr<TileStore> store_;
  std::vector<Mesh> meshes_;
  std::vector<Group> groups_;
  std::vector<std::vector<Node>> children_;
  std::vector<Affine> node_steps_;
  std::vector<Material> materials_;
  GraphSet graphs_;
  std::vector<TexturePtr> textures_;
  std::vector<IesProfile> profiles_;
  std::vector<LightFilter> filters_;
  std::vector<GeometrySet> sets_;
  std::vector<VisibilityRule> visibility_;
  std::vector<Light> lights_, mesh_lights_;
  std::vector<Volume> volumes_;
  std::vector<std::string> light_groups_{kOtherLights};
  std::vector<std::string> attribute_names_;
  std::unordered_map<std::string, uint32_t> attribute_ids_;
  NameTable names_;
  Camera camera_;
  std::vector<std::string> warnings_;
};

}  // namespace wavecomb
