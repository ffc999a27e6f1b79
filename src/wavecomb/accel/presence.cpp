// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/accel/presence.h"

#include <algorithm>
#include <bit>
#include <cmath>

#include "wavecomb/core/encoding/hash.h"
#include "wavecomb/core/sampler.h"
#include "wavecomb/geometry/gaussian_splat/gaussian_splat.h"
#include "wavecomb/geometry/hit/hit_material.h"
#include "wavecomb/geometry/hit/uv.h"
#include "wavecomb/material/inputs/presence.h"
#include "wavecomb/material/lobes/straight_transmission.h"
#include "wavecomb/scene/scene.h"

namespace wavecomb {
namespace {

/// Marks the meshes that are invisible to at least one kind of ray in at least one instance.
void mark_invisible(const Scene& scene, std::vector<uint8_t>& filtered) {
  const SceneGeometry& geometry = *scene.geometry();
  const SceneView view = scene.view();
  for (size_t i = 0; i < geometry.instance_records.size(); ++i) {
    const Group& group = geometry.groups[i == 0 ? 0 : geometry.instances[i - 1].group];
    const uint32_t* visibility = view.visibility + geometry.instance_records[i].emissive;
    for (size_t g = 0; g < group.meshes.size(); ++g)
      if ((visibility[g] & kVisibleToAll) != kVisibleToAll) filtered[group.meshes[g]] = 1;
  }
}

/// Decides at random whether a surface stops a ray, with the given probability.
bool stops_at_random(const SceneView& scene, float probability, const PresenceQuery& at,
                     const PresenceKeys& keys) {
  if (probability >= 1.f) return true;
  if (!(probability > 0.f)) return false;
  const SampleKey<float> path{keys.pixel_hash[size_t{at.slot} * keys.stride],
                              keys.sample[size_t{at.slot} * keys.stride]};
  uint32_t where = hash_u32(at.instance * 0x9e3779b9u + at.mesh, at.prim);
  // A ray may enter and leave the same curve or point, by independent decisions.
  const uint32_t flags = scene.meshes[at.mesh].flags;
  if ((flags & kIsCurved) != 0 && (flags & kIsGaussianSplat) == 0)
    where = hash_u32(hash_u32(where, std::bit_cast<uint32_t>(at.u)), std::bit_cast<uint32_t>(at.v));
  return stratified_1d<float>(path, hash_u32(where, keys.salt)) < probability;
}

/// Returns whether a surface stops a ray that it stops with the given probability on average. A
/// shadow ray with an optical depth passes, and its optical depth increases. The sums are integers,
/// so that they do not depend on the order of hits.
bool stops(const SceneView& scene, float probability, const PresenceQuery& at,
           const PresenceKeys& keys) {
  if (!keys.optical_depth) return stops_at_random(scene, probability, at, keys);
  if (probability >= 1.f) return true;
  if (!(probability > 0.f)) return false;
  uint32_t& sum = keys.optical_depth[at.slot];
  sum += static_cast<uint32_t>(-std::log2(1.f - probability) * kOpticalDepthUnit + 0.5f);
  return sum > kOpaqueDepth;
}

const GaussianSplatRow& gaussian_splat_of(const SceneView& scene, uint32_t mesh, uint32_t prim) {
  return reinterpret_cast<const GaussianSplatRow*>(scene.meshes[mesh].normals)[prim];
}

}  // namespace

std::vector<uint8_t> filtered_meshes(const Scene& scene) {
  const SceneGeometry& geometry = *scene.geometry();
  std::vector<uint8_t> filtered(geometry.meshes.size(), 0);
  if (scene.view().lights.links.members) filtered.assign(filtered.size(), 1);  // shadow linking
  if (scene.view().lights.links.members) return filtered;
  if (scene.view().visibility) mark_invisible(scene, filtered);
  for (size_t m = 0; m < filtered.size(); ++m)
    if (geometry.meshes[m].primitive == Primitive::kGaussianSplat) filtered[m] = 1;
  const MeshMediaView& nested_media = scene.view().nested_media;
  if (!scene.view().has_presence && !nested_media.media) return filtered;
  const auto needs = [&](uint32_t m) {
    const uint32_t flags = scene.material_part()->records[m].flags;
    return (flags & (kPresence | kTransmitsStraight)) != 0 || nested_media.is_bound(m);
  };
  const auto& instances = geometry.instance_records;
  const bool inherited = std::any_of(instances.begin(), instances.end(),
                                     [&](const InstanceRecord& i) { return needs(i.material); });
  for (uint32_t mesh = 0; mesh < filtered.size(); ++mesh)
    filtered[mesh] |= geometry.any_material(mesh, kInheritMaterial, [&](uint32_t m) {
      return m == kInheritMaterial ? inherited : needs(m);
    });
  return filtered;
}

std::vector<uint8_t> fibre_meshes(const Scene& scene) {
  const SceneGeometry& geometry = *scene.geometry();
  const auto& materials = scene.material_part()->shaded;
  std::vector<uint8_t> fibres(geometry.meshes.size(), 0);
  if (std::none_of(materials.begin(), materials.end(),
                   [](const Material& m) { return has_trait(m.program, program_trait::kFibre); }))
    return fibres;
  const auto is_other = [&](uint32_t m) {
    return !has_trait(materials[m].program, program_trait::kFibre);
  };
  // Meshes without a material inherit the material of their instance. Instance 0 contains the
  // objects in world space.
  std::vector<uint8_t> group_inherits(geometry.groups.size(), 0), mesh_inherits(fibres.size(), 0);
  for (size_t i = 0; i < geometry.instance_records.size(); ++i)
    if (is_other(geometry.instance_records[i].material))
      group_inherits[i == 0 ? 0 : geometry.instances[i - 1].group] = 1;
  for (size_t g = 0; g < group_inherits.size(); ++g)
    for (const uint32_t mesh : geometry.groups[g].meshes) mesh_inherits[mesh] |= group_inherits[g];
  for (uint32_t mesh = 0; mesh < fibres.size(); ++mesh)
    fibres[mesh] = geometry.meshes[mesh].is_curved() &&
                   !geometry.any_material(mesh, kInheritMaterial, [&](uint32_t m) {
                     return m == kInheritMaterial ? mesh_inherits[mesh] != 0 : is_other(m);
                   });
  return fibres;
}

bool casts_shadow(const SceneView& scene, uint32_t instance, uint32_t geom, uint32_t slot,
                  const PresenceKeys& keys) {
  const uint32_t set = keys.shadow_set[size_t{slot} * keys.shadow_stride];
  if (set == 0) return true;
  const LinkView& links = scene.lights.links;
  const uint32_t link = links.classes[scene.instances[instance].emissive + geom];
  return (links.members[(link - 1) * links.words + (set - 1) / 32] >> ((set - 1) % 32) & 1) != 0;
}

bool is_present(const SceneView& scene, const PresenceQuery& at, const PresenceKeys& keys) {
  if (scene.has_curves && (scene.meshes[at.mesh].flags & kIsGaussianSplat) != 0)
    return stops_at_random(
        scene, gaussian_splat_alpha(gaussian_splat_of(scene, at.mesh, at.prim), at.u, at.v), at,
        keys);
  const uint32_t material =
      hit_material<float>(scene, scene.instances[at.instance].material, at.mesh, at.prim, true);
  // Medium boundaries do not stop shadow rays. The transmittance of a shadow ray is computed
  // separately (medium/nested/nested_media.h).
  if (keys.ray_kind == kVisibleToShadowRays && scene.nested_media.is_bound(material)) return false;
  const uint32_t flags = scene.materials.materials[material].flags;
  if (keys.passes_straight && (flags & kTransmitsStraight) != 0) {
    const MeshHit<float> hit{at.instance, at.mesh, at.prim, at.u, at.v, at.time};
    const auto cosine = [&](bool lane) {
      return unadjusted_cosine<float>(scene, hit, at.dir, lane);
    };
    const auto straight = straight_transmission<float>(scene, hit, material, cosine, true);
    return stops(scene, 1.f - straight.probability, at, keys);
  }
  if ((flags & kPresence) == 0) return true;
  const float opacity =
      opacity_at<float>(scene.materials, scene.meshes, scene.instances,
                        {.material = material,
                         .instance = at.instance,
                         .mesh_position = {at.mesh, at.prim, at.u, at.v},
                         .uv = hit_uv<float>(scene.meshes, at.mesh, at.prim, at.u, at.v, true)},
                        true);
  return stops(scene, opacity, at, keys);
}

bool accepts_hit(const SceneView& scene, const PresenceQuery& at, const PresenceKeys& keys) {
  if (!is_of_object(keys, at.instance, at.mesh, at.slot)) return false;
  if (scene.visibility &&
      (scene.visibility[scene.instances[at.instance].emissive + at.geom] & keys.ray_kind) == 0)
    return false;
  if (keys.shadow_set && !casts_shadow(scene, at.instance, at.geom, at.slot, keys)) return false;
  return is_present(scene, at, keys);
}

}  // namespace wavecomb
