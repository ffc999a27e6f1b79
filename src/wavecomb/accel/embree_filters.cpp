// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/accel/embree_filters.h"

#include <limits>

#include "wavecomb/accel/light_shapes.h"
#include "wavecomb/accel/presence.h"
#include "wavecomb/core/lanes/lanes.h"

namespace wavecomb {
namespace {

/// Filter function that makes the choice of the closest hit independent of the order in which
/// Embree tests triangles. If two hits have the same distance up to rounding (on shared edges, or
/// where surfaces intersect or coincide), Embree by itself would keep the hit that it tests last,
/// and the order of its tests depends on the other rays of the packet. This filter keeps the hit
/// with the smaller distance, and at equal distances the hit with the smaller id. The filter sets
/// `tfar` slightly beyond the closest hit (`kSlack`), so that Embree tests all candidates.
template <unsigned N>
inline void keep_closest(const RTCFilterFunctionNArguments* args) {
  auto* best = reinterpret_cast<QueryContext*>(args->context);
  int* valid = args->valid;
  float* tfar = &RTCRayN_tfar(args->ray, N, 0);
  using F = Lanes<N>;
  using U = UInt<F>;
  const F t = load<F>(tfar), best_t = load<F>(best->t);
  Mask<F> take = t < best_t;
  const Mask<F> tie = t == best_t;
  if (any(tie)) {
    const U i = load<U>(&RTCHitN_instID(args->hit, N, 0, 0)), bi = load<U>(best->inst);
    const U g = load<U>(&RTCHitN_geomID(args->hit, N, 0)), bg = load<U>(best->geom);
    const U p = load<U>(&RTCHitN_primID(args->hit, N, 0)), bp = load<U>(best->prim);
    take = take | (tie & Mask<F>((i < bi) | ((i == bi) & ((g < bg) | ((g == bg) & (p < bp))))));
  }
  take = take & Mask<F>(load<U>(valid) != U(0u));
  store(best->t, select(take, t, best_t));
  store(tfar, select(take, F(t * kSlack), t));
  store(valid, select(Mask<U>(take), U(0xffffffffu), U(0u)));
}

/// Rejects hits on objects other than the ray's `PresenceKeys::object`.
[[gnu::noinline, gnu::cold]] void reject_other_objects(const RTCFilterFunctionNArguments& args) {
  const auto& context = *reinterpret_cast<const QueryContext*>(args.context);
  const SceneView& scene = *context.scene;
  for (unsigned i = 0; i < args.N; ++i) {
    if (args.valid[i] == 0) continue;
    const unsigned inst = RTCHitN_instID(args.hit, args.N, i, 0);
    const unsigned geom = RTCHitN_geomID(args.hit, args.N, i);
    const bool instanced = inst != RTC_INVALID_GEOMETRY_ID;
    const uint32_t instance = instanced ? inst : 0;
    bool is_specific = instanced || geom < context.first_light;
    if (is_specific) {
      const uint32_t first = scene.instances[instance].geometry;
      const uint32_t mesh =
          scene.geometry_mesh[first + (instanced ? geom : geom - context.first_world)];
      is_specific = is_of_object(*context.keys, instance, mesh, RTCRayN_id(args.ray, args.N, i));
    }
    if (!is_specific) args.valid[i] = 0;
  }
}

const LightGeometry& light_of(const void* user) {
  return *static_cast<const LightGeometry*>(user);
}

/// Intersects ray `i` of a packet with a light. Returns the distance to the light, or 0 for a miss.
float intersect_light_shape(const LightGeometry& light, RTCRayN* ray, unsigned n, unsigned i) {
  const float o[3] = {RTCRayN_org_x(ray, n, i), RTCRayN_org_y(ray, n, i), RTCRayN_org_z(ray, n, i)};
  const float d[3] = {RTCRayN_dir_x(ray, n, i), RTCRayN_dir_y(ray, n, i), RTCRayN_dir_z(ray, n, i)};
  const float t = intersect_custom_shape(light, o, d, RTCRayN_time(ray, n, i));
  return t > 0.f && t <= RTCRayN_tfar(ray, n, i) ? t : 0.f;
}

}  // namespace

bool is_met_by_embree_ids(const QueryContext& context, const PresenceQuery& at, unsigned i) {
  PresenceQuery in_scene = at;
  in_scene.dir = {context.dx[i], context.dy[i], context.dz[i]};
  in_scene.time = context.time ? context.time[i] : 0.f;
  if (at.instance == RTC_INVALID_GEOMETRY_ID) {
    in_scene.instance = 0;
    in_scene.geom = at.geom - context.first_world;
  }
  return accepts_hit(*context.scene, in_scene, *context.keys);
}

void presence_filter(const RTCFilterFunctionNArguments* args) {
  const auto mesh = static_cast<uint32_t>(reinterpret_cast<uintptr_t>(args->geometryUserPtr));
  const auto* context = reinterpret_cast<const QueryContext*>(args->context);
  const unsigned n = args->N;
  for (unsigned i = 0; i < n; ++i) {
    if (args->valid[i] != -1) continue;
    const bool present = is_met_by_embree_ids(*context,
                                              {.instance = RTCHitN_instID(args->hit, n, i, 0),
                                               .geom = RTCHitN_geomID(args->hit, n, i),
                                               .mesh = mesh,
                                               .prim = RTCHitN_primID(args->hit, n, i),
                                               .u = RTCHitN_u(args->hit, n, i),
                                               .v = RTCHitN_v(args->hit, n, i),
                                               .slot = RTCRayN_id(args->ray, n, i)},
                                              i);
    if (!present) args->valid[i] = 0;
  }
}

void closest_filter(const RTCFilterFunctionNArguments* args) {
  if (reinterpret_cast<const QueryContext*>(args->context)->keys->object) [[unlikely]]
    reject_other_objects(*args);
  switch (args->N) {
    case 16:
      return keep_closest<16>(args);
    case 8:
      return keep_closest<8>(args);
    case 4:
      return keep_closest<4>(args);
    default:
      return keep_closest<1>(args);
  }
}

void intersect_lights(const RTCIntersectFunctionNArguments* args) {
  auto* best = reinterpret_cast<QueryContext*>(args->context);
  if (best->keys->object) return;
  const unsigned n = args->N;
  RTCRayN* ray = RTCRayHitN_RayN(args->rayhit, n);
  RTCHitN* hit = RTCRayHitN_HitN(args->rayhit, n);
  const LightGeometry& light = light_of(args->geometryUserPtr);
  for (unsigned i = 0; i < n; ++i) {
    if (args->valid[i] == 0 || !is_hit_by(light, *best->keys, RTCRayN_id(ray, n, i))) continue;
    const float t = intersect_light_shape(light, ray, n, i);
    if (t == 0.f || t > best->t[i]) continue;
    // Among hits at equal distance, choose the hit with the smaller instance id, and among hits on
    // the same instance the hit with the smaller geometry id. Objects in world space have the
    // largest instance id.
    if (t == best->t[i] && (RTCHitN_instID(hit, n, i, 0) != RTC_INVALID_GEOMETRY_ID ||
                            RTCHitN_geomID(hit, n, i) < args->geomID))
      continue;
    best->t[i] = t;
    RTCRayN_tfar(ray, n, i) = t * kSlack;
    RTCHitN_u(hit, n, i) = RTCHitN_v(hit, n, i) = 0.f;
    RTCHitN_primID(hit, n, i) = 0;
    RTCHitN_geomID(hit, n, i) = args->geomID;
    RTCHitN_instID(hit, n, i, 0) = RTC_INVALID_GEOMETRY_ID;
  }
}

void intersect_lights_bare(const RTCIntersectFunctionNArguments* args) {
  const unsigned n = args->N;
  RTCRayN* ray = RTCRayHitN_RayN(args->rayhit, n);
  RTCHitN* hit = RTCRayHitN_HitN(args->rayhit, n);
  const LightGeometry& light = light_of(args->geometryUserPtr);
  if (light.delta_bounces_only) return;
  for (unsigned i = 0; i < n; ++i) {
    if (args->valid[i] == 0) continue;
    const float t = intersect_light_shape(light, ray, n, i);
    if (t == 0.f) continue;
    RTCRayN_tfar(ray, n, i) = t;
    RTCHitN_primID(hit, n, i) = 0;
    RTCHitN_geomID(hit, n, i) = args->geomID;
    RTCHitN_instID(hit, n, i, 0) = RTC_INVALID_GEOMETRY_ID;
  }
}

void occlude_lights(const RTCOccludedFunctionNArguments* args) {
  const LightGeometry& light = light_of(args->geometryUserPtr);
  if (light.delta_bounces_only) return;
  for (unsigned i = 0; i < args->N; ++i)
    if (args->valid[i] != 0 && intersect_light_shape(light, args->ray, args->N, i) > 0.f)
      RTCRayN_tfar(args->ray, args->N, i) = -std::numeric_limits<float>::infinity();
}

void store_bounds(const Bounds& b, RTCBounds& out) {
  out.lower_x = b.lo.x;
  out.lower_y = b.lo.y;
  out.lower_z = b.lo.z;
  out.upper_x = b.hi.x;
  out.upper_y = b.hi.y;
  out.upper_z = b.hi.z;
}

void light_box(const RTCBoundsFunctionArguments* args) {
  const Bounds b = custom_shape_bounds(light_of(args->geometryUserPtr));
  store_bounds(b, *args->bounds_o);
}

}  // namespace wavecomb
