// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/accel/embree_curves.h"

#include <bit>
#include <limits>
#include <tuple>

#include "wavecomb/accel/embree_filters.h"
#include "wavecomb/accel/presence.h"
#include "wavecomb/geometry/curve/intersect.h"

namespace wavecomb {
namespace {

const CurveGeometry& curves_of(const void* user) {
  return *static_cast<const CurveGeometry*>(user);
}

/// Intersects the rays of a packet with the curve segments of a BVH node. Calls `found(i,
/// primitive, hit)` for ray `i` and each segment that it hits. `query` states whether to find the
/// first hit or any hit; hits on curves that are not present for the ray's path are skipped.
/// `wants(slot)` returns whether the ray of a path slot may hit the curves of this mesh.
template <bool kBare, typename Arguments, typename Wants, typename Found>
void for_hits(const Arguments& args, RTCRayN* rays, CurveQuery query, const Wants& wants,
              const Found& found) {
  const CurveGeometry& curves = curves_of(args.geometryUserPtr);
  if (curves.is_filtered) query = CurveQuery::kAll;
  auto* context = reinterpret_cast<QueryContext*>(args.context);
  std::optional<CurveRay> own;
  std::optional<CurveRay>& ray = kBare ? own : context->curve_ray;
  const unsigned inst = args.context->instID[0], n = args.N;
  for (unsigned i = 0; i < n; ++i) {
    if (args.valid[i] == 0 || !wants(RTCRayN_id(rays, n, i))) continue;
    const float o[3] = {RTCRayN_org_x(rays, n, i), RTCRayN_org_y(rays, n, i),
                        RTCRayN_org_z(rays, n, i)};
    const float d[3] = {RTCRayN_dir_x(rays, n, i), RTCRayN_dir_y(rays, n, i),
                        RTCRayN_dir_z(rays, n, i)};
    const float& tfar = RTCRayN_tfar(rays, n, i);
    if (!ray || !ray->is(o, d)) ray.emplace(o, d);
    const auto intersect = [&](const SubSegment& sub_segment) {
      for (const CurveHit& hit : intersect_curve(*curves.mesh, sub_segment, *ray, tfar, query,
                                                 RTCRayN_time(rays, n, i), curves.is_fibre)) {
        if (curves.is_filtered && !is_met_by_embree_ids(*context,
                                                        {.instance = inst,
                                                         .geom = args.geomID,
                                                         .mesh = curves.id,
                                                         .prim = sub_segment.prim,
                                                         .u = hit.u,
                                                         .v = hit.v,
                                                         .slot = RTCRayN_id(rays, n, i)},
                                                        i))
          continue;
        found(i, sub_segment.prim, hit);
        break;
      }
    };
    if (!curves.nodes) {
      intersect({args.primID});
      continue;
    }
    // Embree sets tfar to a negative value after an occlusion hit.
    uint32_t left = curves.nodes->may_hit(args.primID, *ray, tfar);
    for (; left != 0 && tfar >= 0; left &= left - 1)
      intersect(
          curves.nodes->sub_segment(args.primID, static_cast<uint32_t>(std::countr_zero(left))));
  }
}

void put(const RTCIntersectFunctionNArguments* args, unsigned i, uint32_t prim, const CurveHit& hit,
         float tfar) {
  const unsigned n = args->N;
  RTCHitN* to = RTCRayHitN_HitN(args->rayhit, n);
  RTCRayN_tfar(RTCRayHitN_RayN(args->rayhit, n), n, i) = tfar;
  RTCHitN_u(to, n, i) = hit.u;
  RTCHitN_v(to, n, i) = hit.v;
  RTCHitN_primID(to, n, i) = prim;
  RTCHitN_geomID(to, n, i) = args->geomID;
  RTCHitN_instID(to, n, i, 0) = args->context->instID[0];
}

bool wants_all(unsigned) {
  return true;
}

/// Intersection callback of Embree that chooses the closest hit by the same rule as
/// `closest_filter`.
void intersect_curves(const RTCIntersectFunctionNArguments* args) {
  auto* best = reinterpret_cast<QueryContext*>(args->context);
  const unsigned n = args->N, inst = args->context->instID[0];
  const RTCHitN* known = RTCRayHitN_HitN(args->rayhit, n);
  const auto wants = [&](unsigned slot) {
    return is_of_object(*best->keys, inst == RTC_INVALID_GEOMETRY_ID ? 0 : inst,
                        curves_of(args->geometryUserPtr).id, slot);
  };
  const auto found = [&](unsigned i, uint32_t prim, const CurveHit& hit) {
    if (hit.t > best->t[i]) return;
    const auto candidate = std::make_tuple(inst, args->geomID, prim);
    RTCHitN* at = const_cast<RTCHitN*>(known);
    if (hit.t == best->t[i] &&
        candidate >= std::make_tuple(RTCHitN_instID(at, n, i, 0), RTCHitN_geomID(at, n, i),
                                     RTCHitN_primID(at, n, i)))
      return;
    best->t[i] = hit.t;
    put(args, i, prim, hit, hit.t * kSlack);
  };
  for_hits<false>(*args, RTCRayHitN_RayN(args->rayhit, n), CurveQuery::kFirst, wants, found);
}

/// Intersection callback of Embree for queries of `BareTraversal`, which have no `QueryContext`. If
/// several hits have the same distance, the callback keeps any of them.
void intersect_curves_bare(const RTCIntersectFunctionNArguments* args) {
  for_hits<true>(
      *args, RTCRayHitN_RayN(args->rayhit, args->N), CurveQuery::kFirst, wants_all,
      [&](unsigned i, uint32_t prim, const CurveHit& hit) { put(args, i, prim, hit, hit.t); });
}

template <bool kBare>
void occlude_curves(const RTCOccludedFunctionNArguments* args) {
  const auto found = [&](unsigned i, uint32_t, const CurveHit&) {
    RTCRayN_tfar(args->ray, args->N, i) = -std::numeric_limits<float>::infinity();
  };
  for_hits<kBare>(*args, args->ray, CurveQuery::kAny, wants_all, found);
}

void curve_box(const RTCBoundsFunctionArguments* args) {
  const CurveGeometry& curves = curves_of(args->geometryUserPtr);
  store_bounds(curves.nodes ? curves.nodes->bounds(args->primID)
                            : curve_bounds(*curves.mesh, args->primID, args->timeStep),
               *args->bounds_o);
}

}  // namespace

RTCGeometry make_curve_geometry(RTCDevice device, const CurveGeometry& user, HitRule rule) {
  RTCGeometry g = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_USER);
  const size_t count = user.nodes ? user.nodes->count() : user.mesh->primitive_count();
  rtcSetGeometryUserPrimitiveCount(g, static_cast<unsigned>(count));
  rtcSetGeometryTimeStepCount(g, user.mesh->steps);
  // Embree's callbacks only read the user data.
  rtcSetGeometryUserData(g, const_cast<CurveGeometry*>(&user));
  rtcSetGeometryBoundsFunction(g, curve_box, nullptr);
  const bool is_bare = rule == HitRule::kEmbree;
  rtcSetGeometryIntersectFunction(g, is_bare ? intersect_curves_bare : intersect_curves);
  rtcSetGeometryOccludedFunction(g, is_bare ? occlude_curves<true> : occlude_curves<false>);
  rtcCommitGeometry(g);
  return g;
}

}  // namespace wavecomb
