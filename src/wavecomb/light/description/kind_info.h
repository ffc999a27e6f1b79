// SPDX-License-Identifier: Apache-2.0
/// Interface that each kind of light implements for the scene. The kinds are defined in light/, a
/// layer above the scene; light/kinds/kinds.cpp and light/kinds/mesh_light.cpp define the functions
/// declared here.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "wavecomb/geometry/mesh/bounds.h"
#include "wavecomb/light/description/light_builder.h"
#include "wavecomb/light/description/light_records.h"
#include "wavecomb/light/description/light_table.h"
#include "wavecomb/light/tree/light_cluster.h"
#include "wavecomb/texture/texture.h"

namespace wavecomb {

/// Inputs from which a light kind makes its records, and the light set that receives further data
/// such as portals.
struct LightBuildContext {
  LightSet& set;           ///< set to which sampling densities, portals and shapings are added
  const LightSet* before;  ///< as in LightInputs
  double scene_radius;
  std::span<const TexturePtr> textures;
  std::span<const IesProfile> profiles;
  std::span<const LightFilter> filters;
};

/// Light record that is being built, and the power in W on which its selection probability is
/// based.
struct LightBuild {
  LightRecord record{};
  double power = 0;
};

/// Shape of a light that rays can hit: none, the parallelogram given by p, u and v of the record,
/// or a custom shape given by the functions `box` and `intersect`.
enum class LightShape : uint8_t { kNone, kParallelogram, kCustom };

/// Description of a kind of light for the scene and the accelerator. The kernels of a light kind
/// are in its header.
struct LightKindInfo {
  const char* name = "";
  std::vector<const char*> prims;  ///< types of USD prims that are rendered as this kind
  uint32_t traits = 0;             ///< bits of light_trait
  /// Names of the rows of light_table() that this kind uses in addition to the parameters of its
  /// traits and of all lights.
  std::vector<const char*> parameters;
  /// Table rows of parameters specific to this kind, made by specific_parameter().
  std::vector<LightParameter> own;
  /// Sets position, area, radiance and power of a light record. The function is null for mesh
  /// lights, whose records are made by `make_mesh_light()`.
  void (*make)(LightBuild&, const Light&, LightBuildContext&) = nullptr;
  /// Sets the light's bounds for the light tree; the caller initialises the bounds to the point
  /// `light.p` and the intensity power / pi. The function is null if the light tree does not
  /// contain the kind.
  void (*bound)(LightCluster&, const LightRecord& light, double power) = nullptr;
  /// Returns the shape of a light record. The function is null if rays cannot hit this kind of
  /// light.
  LightShape (*shape)(const LightRecord&) = nullptr;
  /// For LightShape::kCustom: a slightly enlarged bounding box, and the distance to the hit along d
  /// in units of |d|, or 0 if the ray does not hit the light. `o` is relative to light.p. Rays are
  /// tested one at a time in double precision, so that a hit does not depend on the other rays of
  /// its packet.
  Bounds (*box)(const LightRecord&) = nullptr;
  double (*intersect)(const LightRecord&, const double* o, const double* d) = nullptr;

  bool has(uint32_t trait) const { return (traits & trait) != 0; }
};

/// Returns the descriptions of all light kinds, indexed by LightKind.
std::span<const LightKindInfo> light_kinds();
inline const LightKindInfo& info_of(LightKind kind) {
  return light_kinds()[static_cast<size_t>(kind)];
}

/// Makes the record of a light and computes its power.
LightBuild make_light(const Light& light, LightBuildContext& context);
/// Packs a light filter.
FilterRecord make_light_filter(const LightFilter& filter);

/// Makes the record of a mesh light instance, with the values that its triangles share.
LightRecord make_mesh_light(const MeshLightInstance& instance, LightBuildContext& context);

/// Packed emissive triangle and its power in W.
struct TriangleBuild {
  TriangleLight light{};
  double power = 0;
};
/// Packs an emissive triangle without setting the index of its texture coordinates.
TriangleBuild make_triangle(const LightSet& set, const EmissiveTriangle& triangle);

}  // namespace wavecomb
