// SPDX-License-Identifier: Apache-2.0
/// An immutable scene, and the builder that makes it.
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <unordered_map>
#include <vector>

#include "wavecomb/geometry/mesh/tangents.h"
#include "wavecomb/medium/description/mesh_medium.h"
#include "wavecomb/medium/description/subsurface.h"
#include "wavecomb/medium/description/volume.h"
#include "wavecomb/scene/camera/camera.h"
#include "wavecomb/scene/scene_parts.h"
#include "wavecomb/scene/scene_view.h"
#include "wavecomb/scene/visibility.h"

namespace wavecomb {

/// Memory used by the arrays of a scene, in bytes.
struct SceneBytes {
  /// Points, indices, radii, normals, tangents, texture coordinates, attributes and face materials.
  uint64_t meshes = 0;
  /// all mip levels, or only the resident tiles if textures are in a texture store
  uint64_t textures = 0;
  uint64_t records = 0;  ///< instances, materials, lights
  uint64_t volumes = 0;  ///< grids
};

/// New values for parts of a scene.
struct SceneEdit {
  std::optional<Camera> camera{};
  std::map<uint32_t, Material> materials{};  ///< by id
  std::map<uint32_t, Light> lights{};        ///< new lights, by index into Scene::lights
  /// World-space transforms that move prims, by prim path. A transform applies to all objects at or
  /// below its prim, after the transforms of the original scene. The identity undoes earlier moves
  /// of the prim. Lights that this edit replaces in `lights` are not moved. Prims that are not
  /// listed keep their last move.
  std::map<std::string, Affine> moves{};
};

class SceneBuilder;
struct PlacedObjects;

/// Geometry, materials, textures, lights and camera, checked and complete. A scene is immutable;
/// any number of renderers and threads may read it.
class Scene : public std::enable_shared_from_this<Scene> {
 public:
  Scene(const Scene&) = delete;
  Scene& operator=(const Scene&) = delete;

  SceneView view() const { return view_; }
  const std::vector<Mesh>& meshes() const { return geometry_->meshes; }
  /// Returns the groups of meshes. Group 0 is the world, whose meshes are in world space and not
  /// instanced.
  const std::vector<Group>& groups() const { return geometry_->groups; }
  /// Returns all instances of groups in world space, with nesting resolved. No entry is an instance
  /// of group 0.
  const std::vector<Instance>& instances() const { return geometry_->instances; }
  const std::vector<Material>& materials() const { return materials_->materials; }
  const std::vector<TexturePtr>& textures() const { return geometry_->textures; }
  /// Returns the tile store of the first texture that has one, or null. The store limits the memory
  /// of textures.
  const TileStore* texture_store() const;
  const std::vector<Light>& lights() const { return lights_->lights; }
  const std::vector<Volume>& volumes() const { return geometry_->volumes; }
  /// Returns the names of light groups; the first is kOtherLights.
  const std::vector<std::string>& light_groups() const { return geometry_->light_groups; }
  /// Returns the index into light_groups() of every light of the light set; triangle lights come
  /// last.
  std::vector<uint32_t> groups_of_lights() const;
  /// Returns a value for every light of the light set: 1 if the light is the emission of an
  /// object's material, and 0 if the light is a light of the stage.
  std::vector<uint8_t> lights_of_objects() const;
  /// Returns the nesting of groups from the world to the instances, with the names of its
  /// placements.
  const std::vector<Placement>& placements() const { return geometry_->placements; }
  const NameTable& names() const { return geometry_->names; }
  const LightSet& light_set() const { return lights_->set; }
  /// Returns the complete light tree; light_set() may contain only an outline of this tree. If the
  /// tree has not been built yet, builds it with `threads` threads (0 means all). Thread-safe.
  const LightTree& light_tree(uint32_t threads) const { return lights_->tree(threads); }
  const Camera& camera() const { return camera_; }
  const Bounds& bounds() const { return geometry_->bounds; }
  /// Return the number of triangles of all meshes: the first function counts each mesh once, the
  /// second counts it for each instance.
  uint64_t unique_triangles() const;
  uint64_t instanced_triangles() const;
  /// Returns the number of curve segments, points or splats, counting each mesh once.
  uint64_t curve_segments() const;
  uint64_t points() const;
  uint64_t splats() const;
  SceneBytes bytes() const;
  /// Returns warnings about scene data that was skipped or has no effect, such as instances with
  /// singular transforms; one line per warning.
  const std::vector<std::string>& warnings() const { return geometry_->warnings; }

  /// Returns a new scene with the values of `edit`. The new scene shares all unchanged data with
  /// this scene. The new scene renders like a scene built from scratch with the new values. After
  /// the first move of an object, the meshes of the world are stored as an instance. `threads` is
  /// the number of threads; 0 means all.
  ///
  /// A camera edit takes microseconds. A material edit copies the materials. An edit of lights or
  /// of emission rebuilds the light set. If a new material needs tangents, the edit computes them.
  /// Edits that change the set of absorbing materials, or that move a light or an object, search
  /// for objects and lights inside absorbing glass. A move of an object also copies the instances,
  /// and rebuilds the light set if the scene has emissive meshes or lights below the prim. Throws
  /// Error with the name of the object if a value is invalid or an id is unknown.
  std::shared_ptr<const Scene> edited(const SceneEdit& edit, uint32_t threads = 0) const;

  /// Return the parts of the scene, so that callers can find out which parts an edited scene shares
  /// with this scene.
  const std::shared_ptr<const SceneGeometry>& geometry() const { return geometry_; }
  const std::shared_ptr<const SceneMaterials>& material_part() const { return materials_; }
  const std::shared_ptr<const SceneLights>& light_part() const { return lights_; }

 private:
  friend class SceneBuilder;
  Scene(std::shared_ptr<const SceneGeometry> geometry,
        std::shared_ptr<const SceneMaterials> materials, std::shared_ptr<const SceneLights> lights,
        std::shared_ptr<const SceneTangents> tangents, std::shared_ptr<const SceneLinks> links,
        const Camera& camera);
  /// Computes the link sets of each object, and the kinds of rays that see the object.
  void link();
  /// Returns the value of `SceneMaterials::in_glass` for an edit of this scene that has the given
  /// geometry, materials and lights.
  bool needs_in_glass(const SceneGeometry& geometry, std::span<const Material> materials,
                      std::span<const Light> lights) const;
  /// Throws Error for values of an edit that are invalid.
  void check(const SceneEdit& edit) const;
  /// Returns the lights of the scene after an edit that moves objects by `moves`.
  std::vector<Light> edited_lights(const SceneEdit& edit,
                                   const std::map<std::string, Affine>& moves) const;
  /// Returns a value for every light of the light set: of_input(light) for a light of the stage,
  /// and of_run(triangles) for the triangle lights of a mesh.
  template <typename T, typename OfInput, typename OfRun>
  std::vector<T> for_all_lights(const OfInput& of_input, const OfRun& of_run) const;

  std::shared_ptr<const SceneGeometry> geometry_;
  std::shared_ptr<const SceneMaterials> materials_;
  std::shared_ptr<const SceneLights> lights_;
  std::shared_ptr<const SceneTangents> tangents_;
  std::shared_ptr<const SceneLinks> links_;  ///< null if the scene has no link sets
  /// Data of SceneView::visibility; null if every object is visible to all rays.
  std::shared_ptr<const std::vector<uint32_t>> visibility_;
  Camera camera_;
  SceneView view_;
  std::shared_ptr<const Scene> unmoved_;  ///< the scene before its objects were moved, or null
  std::map<std::string, Affine> moves_;   ///< moves since `unmoved_`
};

/// Collects the contents of a scene. Ids count from 0 in order of addition.
///
/// Contract: only one thread at a time may use a builder. The caller keeps ownership of mesh
/// arrays, which must live as long as the Scene (see Mesh::owner). If an argument is invalid,
/// functions throw Error with one line that names the object.
class SceneBuilder {
 public:
  /// Makes an empty builder. `threads` is the number of threads that build textures and the scene;
  /// 0 means all. `store` is the texture store for added textures, and several scenes may share it.
  /// If `store` is null, textures stay in memory.
  explicit SceneBuilder(uint32_t threads = 0, std::shared_ptr<TileStore> store = nullptr);
  SceneBuilder(SceneBuilder&&) = default;
  SceneBuilder& operator=(SceneBuilder&&) = default;

  uint32_t add_texture(const TextureDesc& desc);
  /// Adds a texture of another scene. The other scene may be destroyed before this scene.
  uint32_t add_texture(TexturePtr texture);
  /// Makes a UDIM texture from textures that were added before. Tile numbers are from 1001 to 1100.
  /// `missing` is the linear r, g, b, alpha of missing tiles.
  uint32_t add_tiles(const std::string& name,
                     const std::vector<std::pair<uint32_t, uint32_t>>& tiles,
                     const std::array<float, 4>& missing);
  /// Returns the texture with the given id. The reference is valid until the builder is destroyed
  /// or build() is called.
  const Texture& texture(uint32_t id) const;
  /// Adds a value graph for Material::graph, opacity_graph or emission_graph. Outputs are numbered
  /// as in graph/parameters/parameters.h. The texture ids in the graph must exist.
  uint32_t add_graph(const Graph& graph);
  /// Adds a material. The texture and graph ids of the material must exist.
  uint32_t add_material(Material material);
  /// Returns the id of the attribute called `name`, for MeshAttribute and for graphs.
  uint32_t attribute(const std::string& name);
  /// Adds a mesh after checking sizes, indices and radii. Throws Error if a point is not finite.
  /// Faces without area are kept; no ray hits them.
  uint32_t add_mesh(Mesh mesh);
  /// Replaces the arrays of a mesh, with the checks of add_mesh. The mesh keeps its name and light
  /// group, and stays in the same group of meshes.
  void replace_mesh(uint32_t id, Mesh mesh);
  /// Adds an empty group, to hold meshes and instances of other groups. Group 0, the world, always
  /// exists. `root` is the prim path prefix of the names in the group. In the names of objects, the
  /// name of the placement replaces this prefix (ObjectNames).
  uint32_t add_group(std::string name, std::string root = {});
  void add_to_group(uint32_t group, uint32_t mesh);
  /// Instances the group `child` in the group `parent`, nested to any depth without copying
  /// geometry. `material` (or kInheritMaterial) applies to meshes of the child without a material.
  /// `name` is an id of add_placement_name; `number` distinguishes placements of the same name. For
  /// a moving instance, two or more `steps` replace `transform`: transforms at equally spaced
  /// shutter times.
  void add_instance(uint32_t parent, uint32_t child, const Affine& transform,
                    uint32_t material = kInheritMaterial, uint32_t name = kNoName,
                    uint32_t number = kNoName, std::span<const Affine> steps = {});
  /// Adds a name for instances. The first `asset_length` characters of the name are the name of the
  /// asset; 0 means that the asset is unknown.
  uint32_t add_placement_name(std::string_view name, uint32_t asset_length);
  /// Adds a geometry set and returns its id, for Light::light_link and Light::shadow_link.
  uint32_t add_geometry_set(GeometrySet set);
  /// Sets which rays see a prim and its descendants. A later rule for the same path replaces an
  /// earlier rule.
  void add_visibility(VisibilityRule rule);
  /// Adds an IES profile and returns its id, for Shaping::ies.
  uint32_t add_ies(IesProfile profile);
  /// Adds a light filter and returns its id, for Light::filter.
  uint32_t add_light_filter(LightFilter filter);
  uint32_t add_light(Light light);
  /// Adds a light of kind kMeshLight and returns its id, for Mesh::mesh_light. If the light is not
  /// `visible`, the opacity of the mesh does not affect its emission.
  uint32_t add_mesh_light(Light light);
  /// Returns the index of the light group called `name`, for Light::group and Mesh::light_group. An
  /// empty name means the group kOtherLights.
  uint32_t light_group(const std::string& name);
  /// Adds a volume in world space. No surface bounds the volume. Volumes may overlap.
  uint32_t add_volume(Volume volume);
  void set_camera(const Camera& camera);

  /// Checks everything that involves several objects (cycles of groups, singular transforms,
  /// materials) and makes the scene. The builder is empty afterwards. Meshes without a material get
  /// a grey diffuse material.
  std::shared_ptr<const Scene> build();

 private:
  struct Node {
    uint32_t child;
    Affine transform;
    uint32_t material;
    uint32_t name, number;
    StepRange motion;  ///< range of the node's transforms in node_steps_
  };
  /// Returns the number of instances that one placement of `group` adds, counting only groups with
  /// meshes. Throws Error if groups contain each other in a cycle.
  uint64_t count_placements(uint32_t group, uint32_t depth, std::vector<uint64_t>& of_group) const;
  /// Appends the instance `here` of `group` and the instances nested in `group` to `out`. `steps`
  /// are the transforms of `here` over the shutter interval; empty if `here` does not move.
  void flatten(uint32_t group, const Instance& here, std::span<const Affine> steps,
               const std::vector<uint64_t>& counts, std::vector<Instance>& out,
               SceneGeometry& geometry) const;
  /// Returns the transforms to world space of a node over the shutter interval. `outer` are the
  /// transforms of the enclosing group if the group moves, and `still` is its transform otherwise.
  /// Returns an empty list if neither the group nor the node moves.
  std::vector<Affine> composed(std::span<const Affine> outer, const Affine& still,
                               const Node& node) const;
  /// Flattens all groups to a list of instances, leaves out instances with singular transforms, and
  /// checks counts against the limits.
  void flatten_groups(SceneGeometry& geometry);
  /// Adds the internal materials: for meshes without a material, for collisions in volumes and
  /// media, and for exit points of random walks. Returns the index of the first added material,
  /// which is grey.
  uint32_t add_implicit_materials(SceneGeometry& geometry);
  /// Returns SceneMaterials::in_glass, and warns of glass whose absorption comes from a value
  /// graph.
  bool search_glass(const SceneGeometry& geometry);
  /// Warns of glass whose absorption comes from a value graph, if `in_glass` is true or if objects
  /// or lights are inside the glass. In scenes without such objects and lights, the missing
  /// absorption is not visible.
  void warn_of_absorbing_graphs(const PlacedObjects& objects, bool in_glass);
  /// Binds the grey material to instances without a material. Throws Error for materials that were
  /// never added.
  void bind_materials(SceneGeometry& geometry, uint32_t grey) const;
  /// Moves all data except materials, graphs and lights from the builder to `geometry`.
  void move_parts(SceneGeometry& geometry);
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
