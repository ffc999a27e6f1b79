// SPDX-License-Identifier: Apache-2.0
/// Embree callbacks: presence filters, the closest-hit rule, and light shapes.
#pragma once

#include <embree4/rtcore.h>

#include <optional>

#include "wavecomb/accel/embree_accelerator.h"
#include "wavecomb/accel/presence.h"
#include "wavecomb/geometry/curve/ray.h"

namespace wavecomb {

/// Query state that Embree passes to the callbacks: presence data and the closest hits so far of
/// the packet's rays. Packets have native width, so that lane i in a callback is ray i of the
/// packet.
struct alignas(64) QueryContext {
  RTCRayQueryContext base;
  const SceneView* scene;  ///< scene whose materials determine the opacity of hits
  const PresenceKeys* keys;
  /// Embree geometry ids of the world's first mesh and of the first light.
  uint32_t first_world, first_light;
  const unsigned *inst, *geom, *prim;  ///< ids of the hits that Embree holds, one per ray
  alignas(64) float t[16];             ///< exact distances of the hits that Embree holds
  std::optional<CurveRay> curve_ray;   ///< cached ray of the last curve test
};

/// Factor by which tfar exceeds the closest distance, so that traversal finds all tied hits.
inline constexpr float kSlack = 1.f + 0x1p-20f;

/// Returns whether a ray hits a point whose instance and geometry are given by Embree ids: the ray
/// may hit its object, it is present (see is_present()), and for shadow rays it casts a shadow from
/// their light.
bool is_met_by_embree_ids(const QueryContext& context, const PresenceQuery& at);

/// Filter function of geometries with hits that may be rejected; see filtered_meshes(). The
/// geometry's user pointer holds the mesh index.
void presence_filter(const RTCFilterFunctionNArguments* args);
/// Filter function of closest-hit queries, which keeps the closest hit independently of the order
/// of tests.
void closest_filter(const RTCFilterFunctionNArguments* args);

/// Converts a bounding box to Embree's type.
void store_bounds(const Bounds& b, RTCBounds& out);

// Callbacks for light shapes other than parallelograms; the user pointer is a LightGeometry.
void light_box(const RTCBoundsFunctionArguments* args);
/// Intersection callback that keeps the closest hit by the rule of closest_filter().
void intersect_lights(const RTCIntersectFunctionNArguments* args);
/// Intersection callback that keeps the closest hit without a rule for ties, for queries without a
/// QueryContext.
void intersect_lights_bare(const RTCIntersectFunctionNArguments* args);
void occlude_lights(const RTCOccludedFunctionNArguments* args);

}  // namespace wavecomb
