// SPDX-License-Identifier: Apache-2.0
/// Callback functions for Embree: filters that test the presence of surfaces, a filter that chooses
/// the closest hit, and intersection with light shapes.
#pragma once

#include <embree4/rtcore.h>

#include <optional>

#include "wavecomb/accel/embree_accelerator.h"
#include "wavecomb/accel/presence.h"
#include "wavecomb/geometry/curve/ray.h"
#include "wavecomb/geometry/mesh/bounds.h"

namespace wavecomb {

/// State of a query, which Embree passes to the callbacks: the inputs of presence decisions
/// (presence.h), and the closest hits found so far for the rays of the packet. Packets have at most
/// the native width, so that lane `i` in a callback is ray `i` of the packet.
struct alignas(64) QueryContext {
  RTCRayQueryContext base;
  const SceneView* scene;  ///< scene whose materials determine the opacity of hits
  const PresenceKeys* keys;
  /// Embree geometry ids of the first mesh in world space and of the first light.
  uint32_t first_world, first_light;
  const unsigned *inst, *geom, *prim;  ///< ids of the closest hits so far, one value per ray
  const float *dx, *dy, *dz;           ///< directions of the rays in world space, one per ray
  const float* time;                   ///< shutter times, one per ray; null means 0
  alignas(64) float t[16];             ///< exact distances of the closest hits so far
  std::optional<CurveRay> curve_ray;   ///< ray of the last curve test; the next test may reuse it
};

/// Factor by which `tfar` exceeds the distance of the closest hit, so that Embree also finds other
/// hits at the same distance.
inline constexpr float kSlack = 1.f + 0x1p-20f;

/// Calls `accepts_hit` for ray `i` of the packet and a point whose instance and geometry are given
/// by Embree's ids. `at` has neither direction nor time.
bool is_met_by_embree_ids(const QueryContext& context, const PresenceQuery& at, unsigned i);

/// Filter function for the meshes that `filtered_meshes` marks. It rejects hits for which
/// `accepts_hit` returns false. The geometry's user pointer holds the mesh index.
void presence_filter(const RTCFilterFunctionNArguments* args);
/// Filter function of closest-hit queries, which makes the result independent of the order in which
/// primitives are tested.
void closest_filter(const RTCFilterFunctionNArguments* args);

/// Converts a bounding box to Embree's type.
void store_bounds(const Bounds& b, RTCBounds& out);

// Callbacks for light shapes other than parallelograms. The user pointer of the geometry refers to
// a `LightGeometry`.
void light_box(const RTCBoundsFunctionArguments* args);
/// Intersection callback that chooses the closest hit by the same rule as `closest_filter`.
void intersect_lights(const RTCIntersectFunctionNArguments* args);
/// Intersection callback for queries without a `QueryContext`. If several hits have the same
/// distance, the callback keeps any of them.
void intersect_lights_bare(const RTCIntersectFunctionNArguments* args);
void occlude_lights(const RTCOccludedFunctionNArguments* args);

}  // namespace wavecomb
