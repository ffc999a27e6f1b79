// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/accel/embree_curves.h"

#include <limits>
#include <tuple>

#include "wavecomb/accel/embree_filters.h"
#include "wavecomb/accel/presence.h"
#include "wavecomb/curve/intersect.h"

namespace wavecomb {
namespace {

const CurveGeometry& curves_of(const void* user) {
  return *static_cast<const CurveGeometry*>(user);
}

/// Ray i of a packet against one primitive.
CurveHits meet(const CurveGeometry& curves, RTCRayN* ray, unsigned n, unsigned i, unsigned prim) {
  const float o[3] = {RTCRayN_org_x(ray, n, i), RTCRayN_org_y(ray, n, i), RTCRayN_org_z(ray, n, i)};
  const float d[3] = {RTCRayN_dir_x(ray, n, i), RTCRayN_dir_y(ray, n, i), RTCRayN_dir_z(ray, n, i)};
  return intersect_curve(*curves.mesh, prim, o, d, RTCRayN_tfar(ray, n, i), curves.is_filtered,
                         RTCRayN_time(ray, n, i), curves.is_fibre);
}

/// Calls found(i, hit) with the first hit of each of a packet's rays that is there for its path.
template <typename Arguments, typename Found>
void for_first_hits(const Arguments& args, RTCRayN* ray, const Found& found) {
  const CurveGeometry& curves = curves_of(args.geometryUserPtr);
  const auto* context = reinterpret_cast<const QueryContext*>(args.context);
  const unsigned inst = args.context->instID[0];
  for (unsigned i = 0; i < args.N; ++i) {
    if (args.valid[i] == 0) continue;
    for (const CurveHit& hit : meet(curves, ray, args.N, i, args.primID)) {
      if (curves.is_filtered && !is_met(*context, inst, args.geomID, curves.id, args.primID, hit.u,
                                        hit.v, RTCRayN_id(ray, args.N, i)))
        continue;
      found(i, hit);
      break;
    }
  }
}

void put(const RTCIntersectFunctionNArguments* args, unsigned i, const CurveHit& hit, float tfar) {
  const unsigned n = args->N;
  RTCHitN* to = RTCRayHitN_HitN(args->rayhit, n);
  RTCRayN_tfar(RTCRayHitN_RayN(args->rayhit, n), n, i) = tfar;
  RTCHitN_u(to, n, i) = hit.u;
  RTCHitN_v(to, n, i) = hit.v;
  RTCHitN_primID(to, n, i) = args->primID;
  RTCHitN_geomID(to, n, i) = args->geomID;
  RTCHitN_instID(to, n, i, 0) = args->context->instID[0];
}

/// Keeps the closest hit by the rule of closest_filter.
void intersect_curves(const RTCIntersectFunctionNArguments* args) {
  auto* best = reinterpret_cast<QueryContext*>(args->context);
  const unsigned n = args->N;
  const RTCHitN* known = RTCRayHitN_HitN(args->rayhit, n);
  for_first_hits(*args, RTCRayHitN_RayN(args->rayhit, n), [&](unsigned i, const CurveHit& hit) {
    if (hit.t > best->t[i]) return;
    const auto mine = std::make_tuple(args->context->instID[0], args->geomID, args->primID);
    RTCHitN* at = const_cast<RTCHitN*>(known);
    if (hit.t == best->t[i] &&
        mine >= std::make_tuple(RTCHitN_instID(at, n, i, 0), RTCHitN_geomID(at, n, i),
                                RTCHitN_primID(at, n, i)))
      return;
    best->t[i] = hit.t;
    put(args, i, hit, hit.t * kSlack);
  });
}

/// The same where any closest hit will do; such queries have no context of ours.
void intersect_curves_bare(const RTCIntersectFunctionNArguments* args) {
  for_first_hits(*args, RTCRayHitN_RayN(args->rayhit, args->N),
                 [&](unsigned i, const CurveHit& hit) { put(args, i, hit, hit.t); });
}

void occlude_curves(const RTCOccludedFunctionNArguments* args) {
  for_first_hits(*args, args->ray, [&](unsigned i, const CurveHit&) {
    RTCRayN_tfar(args->ray, args->N, i) = -std::numeric_limits<float>::infinity();
  });
}

void curve_box(const RTCBoundsFunctionArguments* args) {
  const Mesh& mesh = *curves_of(args->geometryUserPtr).mesh;
  put_bounds(curve_bounds(mesh, args->primID, args->timeStep), *args->bounds_o);
}

}  // namespace

RTCGeometry make_curve_geometry(RTCDevice device, const CurveGeometry& user, HitRule rule) {
  RTCGeometry g = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_USER);
  rtcSetGeometryUserPrimitiveCount(g, static_cast<unsigned>(user.mesh->primitive_count()));
  rtcSetGeometryTimeStepCount(g, user.mesh->steps);
  rtcSetGeometryUserData(g, const_cast<CurveGeometry*>(&user));  // only read
  rtcSetGeometryBoundsFunction(g, curve_box, nullptr);
  rtcSetGeometryIntersectFunction(
      g, rule != HitRule::kEmbree ? intersect_curves : intersect_curves_bare);
  rtcSetGeometryOccludedFunction(g, occlude_curves);
  rtcCommitGeometry(g);
  return g;
}

}  // namespace wavecomb
