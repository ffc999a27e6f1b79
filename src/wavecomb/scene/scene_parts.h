// SPDX-License-Identifier: Apache-2.0
/// The parts of a scene. Each is immutable and shared by all scenes that edits made of one another
/// without changing it.
#pragma once

#include <algorithm>
#include <atomic>
#include <cstdint>
#include <memory>
#include <mutex>
#include <span>
#include <string>
#include <vector>

#include "wavecomb/scene/interior.h"
#include "wavecomb/scene/light_builder.h"
#include "wavecomb/scene/light_data.h"
#include "wavecomb/scene/links.h"
#include "wavecomb/scene/material_data.h"
#include "wavecomb/scene/mesh.h"
#include "wavecomb/scene/motion.h"
#include "wavecomb/scene/names.h"
#include "wavecomb/scene/visibility.h"
#include "wavecomb/scene/volume.h"
#include "wavecomb/scene/walk_data.h"
#include "wavecomb/texture/texture.h"

namespace wavecomb {

/// An instance as lanes read it: one cache line. Instance 0 is the world itself (identity).
struct alignas(64) InstanceRecord {
  float to_world[12];  ///< rows of A, each followed by its translation
  uint32_t geometry;   ///< first of its group's entries in SceneView::geometry_mesh
  uint32_t material;   ///< for meshes whose material is kInheritMaterial
  uint32_t emissive;   ///< first of its entries in SceneView::emissive_lights, if there are any
  float side;          ///< sign of det A: -1 where the transform mirrors
};
static_assert(sizeof(InstanceRecord) == 64);

struct Bounds {
  Vec3<float> lo{1e30f, 1e30f, 1e30f}, hi{-1e30f, -1e30f, -1e30f};
  bool empty() const { return lo.x > hi.x; }
  void add(const Vec3<float>& p) {
    lo = {p.x < lo.x ? p.x : lo.x, p.y < lo.y ? p.y : lo.y, p.z < lo.z ? p.z : lo.z};
    hi = {p.x > hi.x ? p.x : hi.x, p.y > hi.y ? p.y : hi.y, p.z > hi.z ? p.z : hi.z};
  }
  void add(const Bounds& b) {
    if (b.empty()) return;
    add(b.lo);
    add(b.hi);
  }
};

/// A group of meshes that is committed once and instanced any number of times.
struct Group {
  std::string name;
  std::vector<uint32_t> meshes;
  std::string root;  ///< prim path that its meshes' names begin with
};

/// One placement of a group.
struct Instance {
  uint32_t group = 0;
  Affine to_world;
  uint32_t material = kInheritMaterial;
  uint32_t placement = kNoName;  ///< index into Scene::placements
  StepRange motion;              ///< of SceneGeometry::steps
};

/// Light groups that a stage may have, with that of lights without one.
inline constexpr uint32_t kMaxLightGroups = 64;
/// The group of lights without one, group 0.
inline constexpr const char* kOtherLights = "other";

/// What no edit changes: shapes and where they are, textures, names.
struct SceneGeometry {
  std::vector<Mesh> meshes;
  /// By mesh with materials of faces: which ones, each once. Empty for other meshes.
  std::vector<std::vector<uint32_t>> face_materials;
  std::vector<Group> groups;
  std::vector<Instance> instances;
  std::vector<TexturePtr> textures;
  std::vector<IesProfile> profiles;
  std::vector<LightFilter> filters;
  std::vector<GeometrySet> sets;
  std::vector<VisibilityRule> visibility;
  std::vector<Light> mesh_lights;  ///< Mesh::mesh_light
  std::vector<Volume> volumes;
  std::vector<std::string> light_groups;
  std::vector<Placement> placements;
  NameTable names;
  Bounds bounds;
  float radius = 1;  ///< of the bounding sphere
  std::vector<std::string> warnings;

  std::vector<MeshRecord> mesh_records;
  std::vector<InstanceRecord> instance_records;
  std::vector<uint32_t> geometry_mesh;
  std::vector<TextureView> texture_views;
  std::vector<std::string> attribute_names;        ///< by id
  std::vector<AttributeRecord> attribute_records;  ///< AttributeView::records
  std::vector<uint32_t> mesh_attributes;           ///< AttributeView::of_mesh; empty: none has any
  std::vector<MeshMotion> mesh_motions;
  std::vector<MatrixStep> steps;  ///< of all instances that move
  std::vector<VolumeRecord> volume_records;
  uint32_t first_volume_material = 0;  ///< VolumeView::first_material
  /// WalkView::exit_material; kInheritMaterial: no material had a radius, and nobody can walk.
  uint32_t exit_material = kInheritMaterial;
  std::vector<StepRange> instance_motions;  ///< by instance record; empty where none moves
  bool moves() const {
    return mesh_motions.size() > 1 || !steps.empty() ||
           std::ranges::any_of(volumes, &Volume::moves);
  }
  AttributeView attributes() const {
    if (mesh_attributes.empty()) return {};
    return {attribute_records.data(), mesh_attributes.data()};
  }

  /// Runs test(material) for what faces of `mesh` wear where the instance's own is `inherited`,
  /// until it says yes.
  template <typename Test>
  bool any_material(uint32_t mesh, uint32_t inherited, const Test& test) const {
    const auto worn = [&](uint32_t m) { return test(m == kInheritMaterial ? inherited : m); };
    if (meshes[mesh].face_materials.empty()) return worn(meshes[mesh].material);
    for (uint32_t m : face_materials[mesh])
      if (worn(m)) return true;
    return false;
  }
};

/// Materials, and as lanes read them.
struct SceneMaterials {
  /// `textures`: those of the scene, which materials and graphs read. `exit_material`: of
  /// SceneGeometry. `in_glass`: see the member. Appends the material of collisions inside of meshes
  /// to `materials` if it is needed.
  SceneMaterials(std::vector<Material> materials, std::shared_ptr<const GraphSet> graphs,
                 std::span<const TexturePtr> textures, uint32_t exit_material, bool in_glass);
  /// All materials but the one of collisions inside of meshes.
  std::vector<Material> given() const;

  std::vector<Material> materials;  ///< as they were told
  std::vector<Material> shaded;     ///< the same, settled (settled_material.h)
  std::shared_ptr<const GraphSet> graphs;
  std::vector<MaterialRecord> records;
  std::vector<TextureUseRecord> uses;
  std::vector<uint32_t> programs;  ///< by material
  std::vector<uint32_t> variants;  ///< by material: of its program, the least one
  /// By material: whether tangents that vary smoothly show on it (mesh_tangents.h).
  std::vector<uint8_t> wants_tangents;
  std::vector<OpenPbrRecord> openpbr;  ///< of the materials of that program
  /// By material; empty where no program has parameters to itself.
  std::vector<ProgramParameterRecord> own;
  std::vector<WalkMedium<float>> walks;          ///< by material; empty where nobody walks
  std::vector<InteriorMedium<float>> interiors;  ///< by material; empty where nobody asks
  /// InteriorView::event_material, the last material; kInheritMaterial if `interiors` is empty.
  uint32_t inside_material = kInheritMaterial;
  /// Whether paths need to know which absorbing glass they are inside of: it holds objects or
  /// lights (scene/contents.h), or the scene has volumes.
  bool in_glass = false;
  /// Whether the absorption of some glass comes from a value graph (absorbs_by_graph).
  bool has_absorbing_graphs = false;
  bool has_presence = false, has_emission = false;
};

/// Lights of the stage and emissive triangles.
struct SceneLights {
  /// Triangles of all meshes whose materials emit become lights. `before`: of a scene with the same
  /// geometry, to take over what is the same; or null.
  SceneLights(std::vector<Light> lights, const SceneGeometry& geometry,
              const SceneMaterials& materials, const SceneLights* before);

  /// The tree of lights, built by the first who asks where the set has but its outline. Any thread.
  const LightTree& tree(uint32_t threads) const;
  /// Bytes of nodes and trails, wherever they are.
  uint64_t tree_bytes() const;

  std::vector<Light> lights;
  LightSet set;
  std::vector<uint32_t> emissive;     ///< SceneView::emissive_lights; empty where nothing emits
  std::vector<uint32_t> mesh_lights;  ///< SceneView::mesh_lights; empty where there are none
  /// Of the triangle lights from `first` on, up to those of the next entry.
  struct TriangleGroup {
    uint32_t first, group;
    bool is_light;  ///< of a mesh light, and not of a material that glows
  };
  std::vector<TriangleGroup> triangle_groups;

 private:
  mutable std::once_flag grown_;
  mutable LightTree late_tree_;
  mutable std::atomic<uint64_t> late_bytes_{0};
};

}  // namespace wavecomb
