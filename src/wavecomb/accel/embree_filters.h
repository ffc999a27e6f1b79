// SPDX-License-Identifier: Apache-2.0
/// What Embree calls back while it traces: who is there, and which hit is the closest.
#pragma once

#include <embree4/rtcore.h>

#include <optional>

#include "wavecomb/accel/embree_accelerator.h"
#include "wavecomb/curve/ray.h"

namespace wavecomb {

/// Handed through Embree to the filters: the rays' paths, and the closest hits so far of the
/// packet's rays. Packets are traced at widths that Embree has natively, so lane i there is lane i
/// here.
struct alignas(64) QueryContext {
  RTCRayQueryContext base;
  const SceneView* scene;  ///< whose materials say what is present
  const PresenceKeys* keys;
  uint32_t first_world, first_light;   ///< geometry ids of the world's first mesh, and of lights
  const unsigned *inst, *geom, *prim;  ///< of the hits that Embree holds, W each
  alignas(64) float t[16];             ///< their true distances
  std::optional<CurveRay> curve_ray;   ///< that curves were last asked for
};

/// Hits farther than the closest by less than this fraction are looked at still.
inline constexpr float kSlack = 1.f + 0x1p-20f;

/// Whether a ray of path `slot` meets a hit, whose ids are Embree's: it is present, and for a
/// shadow ray, in the way of its light.
bool is_met(const QueryContext& context, unsigned hit_inst, unsigned geom, uint32_t mesh,
            uint32_t prim, float u, float v, uint32_t slot);

/// Filter of geometries with partly present materials, and of all where lights are linked; their
/// user pointer is the number of the mesh.
void presence_filter(const RTCFilterFunctionNArguments* args);
/// Filter of queries: makes the closest hit independent of the order in which triangles are tried.
void closest_filter(const RTCFilterFunctionNArguments* args);

/// A box as Embree takes it.
void put_bounds(const Bounds& b, RTCBounds& out);

// Round lights: user geometries whose user pointer is a LightRecord.
void light_box(const RTCBoundsFunctionArguments* args);
/// Keeps the closest hit by the same rule as closest_filter.
void intersect_lights(const RTCIntersectFunctionNArguments* args);
/// The same where any closest hit will do.
void intersect_lights_bare(const RTCIntersectFunctionNArguments* args);
void occlude_lights(const RTCOccludedFunctionNArguments* args);

}  // namespace wavecomb
