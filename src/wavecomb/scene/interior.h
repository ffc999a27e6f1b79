// SPDX-License-Identifier: Apache-2.0
/// What fills meshes: media inside of glass and liquids, and fog that a mesh bounds.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "wavecomb/core/fields.h"
#include "wavecomb/core/vec.h"

namespace wavecomb {

struct Material;
struct GraphSet;

/// What a surface is to who crosses it.
enum class InteriorKind : uint32_t {
  kNone,      ///< the bound of nothing
  kRefracts,  ///< of glass or a liquid
  kClear,     ///< of what has the index of the air, and does nothing itself: a bound of fog
};

/// What is inside of a surface, as kernels read it: by material.
template <typename F>
struct InteriorMedium {
  Color<F> absorption, scattering;  ///< coefficients, one over a unit of length
  F anisotropy;                     ///< mean cosine of the scattering angle
  F ior;
  F priority;    ///< where several overlap the highest counts, of equal ones the last entered
  UInt<F> kind;  ///< InteriorKind
  Vec3<F> pad, pad_too;
  WAVECOMB_FIELDS(absorption, scattering, anisotropy, ior, priority, kind, pad, pad_too)
};
static_assert(sizeof(InteriorMedium<float>) == 64);

/// What kernels need of all interiors.
struct InteriorView {
  /// By material; null: nobody asks what paths are inside of, and what is inside absorbs where a
  /// path comes out (integrate/steps/interact.h).
  const InteriorMedium<float>* media = nullptr;
  uint32_t event_material = 0;  ///< shades collisions in clear bounds

  bool is_bound(uint32_t material) const {
    return media && media[material].kind != static_cast<uint32_t>(InteriorKind::kNone);
  }
};

/// Whether a material is a solid that transmits light, possibly by a value graph, and absorbs it
/// inside with constant coefficients.
bool absorbs_inside(const Material& material, const GraphSet& graphs);
/// Whether a material is a solid that transmits light and absorbs it inside as a value graph says.
/// The graph is evaluated where a path leaves the glass, so that the coefficients of a segment
/// depend on its direction.
bool absorbs_by_graph(const Material& material, const GraphSet& graphs);
/// Whether a material needs paths to know what they are inside of: it scatters, has a priority, or
/// bounds an absorbing medium that does not refract. With `absorbing` it does, too, where it
/// absorbs: in a scene of volumes, where a path that a volume scatters inside of it has come part
/// of its way before, and where objects are inside of absorbing glass (scene/contents.h).
bool asks_for_interiors(const Material& material, const GraphSet& graphs, bool absorbing);
/// Appends the material that shades collisions inside of meshes if a material asks for interiors.
/// Returns its number, else kInheritMaterial.
uint32_t add_inside_material(std::vector<Material>& materials, const GraphSet& graphs,
                             bool absorbing);
/// The media of all materials; none where no material asks for them.
std::vector<InteriorMedium<float>> make_interiors(std::span<const Material> materials,
                                                  const GraphSet& graphs, bool absorbing);

}  // namespace wavecomb
