// SPDX-License-Identifier: Apache-2.0
/// What a scene asks of each kind of light. The kinds have their rooms in light/, above the scene,
/// which finds them through these functions: light/kinds.cpp and light/mesh_light.cpp have them.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "wavecomb/scene/light_builder.h"
#include "wavecomb/scene/light_cluster.h"
#include "wavecomb/scene/light_data.h"
#include "wavecomb/scene/light_table.h"
#include "wavecomb/scene/scene_parts.h"

namespace wavecomb {

/// What a kind needs to make records, and where it puts what goes with them.
struct LightMaking {
  LightSet& set;           ///< takes densities, portals and shapings
  const LightSet* before;  ///< as build_lights takes it
  double scene_radius;
  std::span<const TexturePtr> textures;
  std::span<const IesProfile> profiles;
  std::span<const LightFilter> filters;
};

/// A record in the making, and the power that its choice rests on.
struct MadeLight {
  LightRecord record{};
  double power = 0;
};

/// What rays meet: nothing, the parallelogram p, u, v of the record, or what the kind's own
/// functions say.
enum class LightShape : uint8_t { kNone, kParallelogram, kOwn };

/// A kind of light, as the scene and the accelerator see it. Kernels are in its header.
struct LightKindInfo {
  const char* name = "";
  std::vector<const char*> prims;  ///< types of USD prims that are drawn as one
  uint32_t traits = 0;             ///< of light_trait
  /// Rows of light_table() that not all lights have, nor all of its traits, by name.
  std::vector<const char*> parameters;
  /// Rows of its own, made by own_parameter.
  std::vector<LightParameter> own;
  /// Fills place, area, radiance and power in. Null: made otherwise.
  void (*make)(MadeLight&, const Light&, LightMaking&) = nullptr;
  /// Bounds for the light tree, which are `light.p` and power / pi before. Null: not in the tree.
  void (*bound)(LightCluster&, const LightRecord& light, double power) = nullptr;
  /// Null: rays meet nothing.
  LightShape (*shape)(const LightRecord&) = nullptr;
  /// Of shapes of their own: a box around, a little larger, and the distance along d to it in units
  /// of |d|, where `o` is relative to light.p; 0 where it is not ahead. In double precision and one
  /// ray at a time, so that a hit is the same whatever the rays beside it are.
  Bounds (*box)(const LightRecord&) = nullptr;
  double (*intersect)(const LightRecord&, const double* o, const double* d) = nullptr;

  bool has(uint32_t trait) const { return (traits & trait) != 0; }
};

/// All kinds, by LightKind.
std::span<const LightKindInfo> light_kinds();
inline const LightKindInfo& info_of(LightKind kind) {
  return light_kinds()[static_cast<size_t>(kind)];
}

/// The record of a light, and its power.
MadeLight make_light(const Light& light, LightMaking& making);
/// A filter as lanes read it.
FilterRecord make_light_filter(const LightFilter& filter);

/// What the triangles of a placed mesh light have in common.
LightRecord make_mesh_light(const PlacedMeshLight& placed, LightMaking& making);

struct MadeTriangle {
  TriangleLight light{};
  double power = 0;
};
/// The index of the texture coordinates is left to the caller.
MadeTriangle make_triangle(const LightSet& set, const EmissiveTriangle& triangle);

}  // namespace wavecomb
