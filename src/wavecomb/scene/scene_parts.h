// SPDX-License-Identifier: Apache-2.0
/// Parts of a scene. Each part is immutable. Scenes derived from one another by edits share the
/// parts that no edit has changed.
#pragma once

#include <algorithm>
#include <atomic>
#include <cstdint>
#include <memory>
#include <mutex>
#include <span>
#include <string>
#include <vector>

#include "wavecomb/geometry/mesh/bounds.h"
#include "wavecomb/geometry/mesh/mesh.h"
#include "wavecomb/geometry/mesh/motion.h"
#include "wavecomb/light/description/light.h"
#include "wavecomb/light/description/light_builder.h"
#include "wavecomb/light/description/linking.h"
#include "wavecomb/material/description/material.h"
#include "wavecomb/medium/description/mesh_medium.h"
#include "wavecomb/medium/description/subsurface.h"
#include "wavecomb/medium/description/volume.h"
#include "wavecomb/scene/names.h"
#include "wavecomb/scene/scene_view.h"
#include "wavecomb/scene/visibility.h"
#include "wavecomb/texture/texture.h"

namespace wavecomb {

/// A group of meshes, built once for traversal and instanced any number of times.
struct Group {
  std::string name;
  std::vector<uint32_t> meshes;
  std::string root;  ///< prim path prefix of the names of the group's meshes
};

/// An instance of a group in world space.
struct Instance {
  uint32_t group = 0;
  Affine to_world;
  uint32_t material = kInheritMaterial;
  /// Index into Scene::placements. The value is kNoName for the instance that contains the meshes
  /// of the world after an edit has moved an object.
  uint32_t placement = kNoName;
  StepRange motion;  ///< range of SceneGeometry::steps
};

/// Maximum number of light groups of a USD stage, including kOtherLights.
inline constexpr uint32_t kMaxLightGroups = 64;
/// Name of group 0, for lights without a group.
inline constexpr const char* kOtherLights = "other";

/// Scene data that does not change when materials, lights or the camera are edited: shapes,
/// transforms, textures and names. A scene with moved objects has a copy of this data with
/// different instances (scene/moves.h).
struct SceneGeometry {
  std::vector<Mesh> meshes;
  /// Distinct face materials of each mesh; empty for meshes without face materials.
  std::vector<std::vector<uint32_t>> face_materials;
  std::vector<Group> groups;
  std::vector<Instance> instances;
  std::vector<TexturePtr> textures;
  std::vector<IesProfile> profiles;
  std::vector<LightFilter> filters;
  std::vector<GeometrySet> sets;
  std::vector<VisibilityRule> visibility;
  std::vector<Light> mesh_lights;  ///< indexed by Mesh::mesh_light
  std::vector<Volume> volumes;
  std::vector<std::string> light_groups;
  std::vector<Placement> placements;
  NameTable names;
  Bounds bounds;
  float radius = 1;  ///< radius of the bounding sphere
  std::vector<std::string> warnings;

  std::vector<Bounds> mesh_boxes;  ///< bounds of each mesh, by mesh_bounds()
  std::vector<MeshRecord> mesh_records;
  std::vector<InstanceRecord> instance_records;
  std::vector<uint32_t> geometry_mesh;
  std::vector<TextureView> texture_views;
  std::vector<std::string> attribute_names;        ///< by id
  std::vector<AttributeRecord> attribute_records;  ///< AttributeView::records
  /// AttributeView::of_mesh; empty if no mesh has attributes.
  std::vector<uint32_t> mesh_attributes;
  std::vector<MeshMotion> mesh_motions;
  std::vector<MatrixStep> steps;  ///< transforms of all moving instances
  std::vector<VolumeRecord> volume_records;
  uint32_t first_volume_material = 0;  ///< VolumeView::first_material
  /// SubsurfaceView::exit_material; kInheritMaterial if no material has a subsurface radius, so
  /// that the scene has no subsurface random walks.
  uint32_t exit_material = kInheritMaterial;
  /// Ranges of `steps`, indexed by instance record; empty if no instance moves.
  std::vector<StepRange> instance_motions;
  bool moves() const {
    return mesh_motions.size() > 1 || !steps.empty() ||
           std::ranges::any_of(volumes, &Volume::moves);
  }
  AttributeView attributes() const {
    if (mesh_attributes.empty()) return {};
    return {attribute_records.data(), mesh_attributes.data()};
  }

  /// Returns whether test(material) is true for the material of any face of `mesh`. `inherited` is
  /// the material of the instance.
  template <typename Test>
  bool any_material(uint32_t mesh, uint32_t inherited, const Test& test) const {
    const auto bound_material = [&](uint32_t m) {
      return test(m == kInheritMaterial ? inherited : m);
    };
    if (meshes[mesh].face_materials.empty()) return bound_material(meshes[mesh].material);
    for (uint32_t m : face_materials[mesh])
      if (bound_material(m)) return true;
    return false;
  }
};

/// Computes `geometry_mesh`, `instance_records`, `bounds` and `radius` from the groups and
/// instances of `geometry`. Record 0, the world, keeps its material.
void place_instances(SceneGeometry& geometry);

/// Materials and their packed form.
struct SceneMaterials {
  /// Packs materials. `textures` are the scene's textures, which materials and graphs read, and
  /// `exit_material` is SceneGeometry::exit_material. If a material needs a medium stack, appends
  /// an internal material for collisions inside meshes to `materials`. Whether absorbing glass
  /// needs a medium stack depends on `in_glass`.
  SceneMaterials(std::vector<Material> materials, std::shared_ptr<const GraphSet> graphs,
                 std::span<const TexturePtr> textures, uint32_t exit_material, bool in_glass);
  /// Returns the materials without the internal material for collisions inside meshes.
  std::vector<Material> given() const;

  /// materials as passed to the constructor, before simplification
  std::vector<Material> materials;
  std::vector<Material> shaded;  ///< materials after simplified() (simplified_material.h)
  std::shared_ptr<const GraphSet> graphs;
  std::vector<MaterialRecord> records;
  std::vector<TextureUseRecord> uses;
  std::vector<uint32_t> programs;  ///< by material
  std::vector<uint32_t> variants;  ///< least expensive variant of the program of each material
  /// 1 for each material whose shading depends on smooth tangents, else 0 (tangents.h).
  std::vector<uint8_t> wants_tangents;
  std::vector<OpenPbrRecord> openpbr;  ///< records of materials of the program openpbr
  /// Program-specific parameters by material; empty if no material's program has any.
  std::vector<ProgramParameterRecord> own;
  /// Tables of straight transmission, and the index of each material's table or kNoStraightTable;
  /// empty if no material has a table (MaterialView).
  std::vector<uint32_t> straight_table;
  std::vector<float> straight_tables;
  /// Subsurface media by material; empty if there are no subsurface random walks.
  std::vector<SubsurfaceMedium<float>> walks;
  /// Media inside meshes by material; empty if paths need no medium stack.
  std::vector<MeshMedium<float>> nested_media;
  /// MeshMediaView::event_material, the last material; kInheritMaterial if `nested_media` is empty.
  uint32_t event_material = kInheritMaterial;
  /// Whether paths must track the absorbing glass that they are inside of, because the glass
  /// contains objects or lights (medium/description/glass_contents.h) or the scene has volumes.
  bool in_glass = false;
  /// Whether the absorption of some glass comes from a value graph (absorbs_by_graph).
  bool has_absorbing_graphs = false;
  bool has_presence = false, has_emission = false;
};

/// Lights of the stage and emissive triangles.
struct SceneLights {
  /// Packs the lights, and adds a light for each triangle of all meshes with emissive materials.
  /// `before` may be null or the lights of a scene with the same geometry; data that has not
  /// changed is then reused.
  SceneLights(std::vector<Light> lights, const SceneGeometry& geometry,
              const SceneMaterials& materials, const SceneLights* before);

  /// Returns the complete light tree. If `set` contains only an outline of the tree, the first call
  /// builds the tree. Thread-safe.
  const LightTree& tree(uint32_t threads) const;
  /// Returns the size in bytes of the nodes and trails of the tree.
  uint64_t tree_bytes() const;

  std::vector<Light> lights;
  LightSet set;
  std::vector<uint32_t> emissive;  ///< SceneView::emissive_lights; empty if nothing emits
  /// SceneView::mesh_lights; empty if the scene has no mesh lights
  std::vector<uint32_t> mesh_lights;
  /// Light group of a range of triangle lights. The range begins at `first` and ends at the next
  /// entry's `first`.
  struct TriangleGroup {
    uint32_t first, group;
    /// true for triangles of a mesh light, false for triangles with an emissive material
    bool is_light;
  };
  std::vector<TriangleGroup> triangle_groups;

 private:
  mutable std::once_flag grown_;
  mutable LightTree lazy_tree_;
  mutable std::atomic<uint64_t> lazy_bytes_{0};
};

}  // namespace wavecomb
