// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/wave/cost_calibration.h"

#include <algorithm>

#include "wavecomb/core/settings.h"
#include "wavecomb/scene/scene.h"

namespace wavecomb {
namespace {

/// Maximum number of instances to search. This number suffices to find every material of a typical
/// scene and takes negligible time.
constexpr size_t kMaxInstances = 1 << 14;
/// Number of faces to inspect in each mesh, evenly spaced.
constexpr size_t kFaces = 256;

}  // namespace

std::vector<CalibrationHits> find_calibration_hits(const Scene& scene) {
  const SceneView view = scene.view();
  std::vector<CalibrationHits> of_material(scene.materials().size());
  const size_t instances = std::min(scene.instances().size() + 1, kMaxInstances);
  for (uint32_t inst = 0; inst < instances; ++inst) {
    const Group& group = scene.groups()[inst == 0 ? 0 : scene.instances()[inst - 1].group];
    for (uint32_t geom = 0; geom < group.meshes.size(); ++geom) {
      const uint32_t mesh_id = group.meshes[geom];
      const Mesh& mesh = scene.meshes()[mesh_id];
      const size_t faces = mesh.primitive_count();
      const size_t step = std::max<size_t>(1, faces / kFaces);
      for (size_t f = 0; f < faces; f += step) {
        uint32_t material = mesh.face_materials.empty() ? mesh.material : mesh.face_materials[f];
        if (material == kInheritMaterial) material = view.instances[inst].material;
        CalibrationHits& hits = of_material[material];
        if (hits.distinct == CalibrationHits::kMax) {
          if (mesh.face_materials.empty()) break;
          continue;
        }
        hits.hits[hits.distinct++] = {inst, mesh_id, geom, static_cast<uint32_t>(f)};
      }
    }
  }
  std::vector<CalibrationHits> found;
  for (uint32_t m = 0; m < of_material.size(); ++m) {
    if (of_material[m].distinct == 0) continue;
    found.push_back(of_material[m]);
    found.back().material = m;
  }
  return found;
}

std::vector<MaterialTraits> material_traits(const Scene& scene) {
  std::vector<MaterialTraits> traits;
  const SceneView view = scene.view();
  for (const Material& material : scene.material_part()->shaded) {
    MaterialTraits t;
    t.program = view.material_variant[traits.size()];
    t.graph = material.graph;
    for (const TextureUse& use : material.textures) {
      if (use.texture == kNoTexture) continue;
      const uint64_t bytes = scene.textures()[use.texture]->spanned_bytes();
      if (t.texture == MaterialTraits::kNone || bytes > t.texture_bytes) {
        t.texture = use.texture;
        t.texture_bytes = bytes;
      }
    }
    traits.push_back(t);
  }
  return traits;
}

CostSnapshot model_costs(const Scene& scene) {
  constexpr float kTextureNs = 25;
  CostSnapshot costs;
  costs.texture_ns.assign(scene.textures().size(), kTextureNs);
  float sum = 0;
  for (const Material& material : scene.material_part()->shaded) {
    float ns = info_of(material.program).model_ns;
    for (const TextureUse& use : material.textures)
      if (use.texture != kNoTexture) ns += kTextureNs;
    costs.material_ns.push_back(ns);
    sum += ns;
  }
  costs.mean_ns = sum / static_cast<float>(scene.materials().size());
  return costs;
}

}  // namespace wavecomb
