// SPDX-License-Identifier: Apache-2.0
/// Media inside meshes: glass, liquids, and fog that a mesh bounds.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "wavecomb/core/rows/fields.h"
#include "wavecomb/core/vec.h"

namespace wavecomb {

struct Material;
struct GraphSet;

/// Role of a surface as the boundary of a medium.
enum class BoundaryKind : uint32_t {
  kNone,      ///< bounds no medium
  kRefracts,  ///< refractive boundary of glass or a liquid
  kClear,  ///< boundary of fog: index of refraction 1, no scattering or absorption at the surface
};

/// Packed medium behind a surface, one record for each material.
template <typename F>
struct MeshMedium {
  Color<F> absorption, scattering;  ///< coefficients, per unit of length
  F anisotropy;                     ///< mean cosine of the scattering angle
  F ior;
  /// Priority where media overlap: rays travel in the medium of the highest priority. If priorities
  /// are equal, rays travel in the medium that they entered last.
  F priority;
  UInt<F> kind;  ///< BoundaryKind
  Vec3<F> pad, pad_too;
  WAVECOMB_FIELDS(absorption, scattering, anisotropy, ior, priority, kind, pad, pad_too)
};
static_assert(sizeof(MeshMedium<float>) == 64);

/// Device view of the media of all materials.
struct MeshMediaView {
  /// Array of media, indexed by material. If no material needs a medium stack, the pointer is null,
  /// and absorption is applied at the hit where a path leaves the solid (path/steps/interact.h).
  const MeshMedium<float>* media = nullptr;
  uint32_t event_material = 0;  ///< material that shades collisions in media with clear boundaries

  bool is_bound(uint32_t material) const {
    return media && media[material].kind != static_cast<uint32_t>(BoundaryKind::kNone);
  }
};

/// Returns whether a material is a transmissive solid that absorbs light with constant
/// coefficients. The amount of transmission may come from a value graph.
bool is_absorbing_solid(const Material& material, const GraphSet& graphs);
/// Returns whether a material is a transmissive solid whose absorption is driven by a value graph.
/// The graph is evaluated at the point where a path leaves the glass, so the absorption along a ray
/// segment depends on the direction of travel.
bool absorbs_by_graph(const Material& material, const GraphSet& graphs);
/// Returns whether paths must track a medium stack because of a material: the material scatters
/// inside, has a priority, or bounds an absorbing medium without refraction. If `absorbing` is set,
/// any absorbing medium needs a medium stack. Set `absorbing` for scenes in which ray segments
/// inside a solid need not end at its surface: scenes with volumes, and scenes with objects inside
/// absorbing glass (medium/description/glass_contents.h).
bool needs_medium_stack(const Material& material, const GraphSet& graphs, bool absorbing);
/// Appends the material that shades collisions inside meshes, and returns its index. If no material
/// needs a medium stack, appends nothing and returns kInheritMaterial.
uint32_t add_inside_material(std::vector<Material>& materials, const GraphSet& graphs,
                             bool absorbing);
/// Makes the media of all materials. The result is empty if no material needs a medium stack.
std::vector<MeshMedium<float>> make_mesh_media(std::span<const Material> materials,
                                               const GraphSet& graphs, bool absorbing);

}  // namespace wavecomb
