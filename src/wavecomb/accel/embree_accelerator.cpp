// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/accel/embree_accelerator.h"

#include <embree4/rtcore.h>

#include <algorithm>
#include <cstring>
#include <limits>

#include "wavecomb/accel/embree_filters.h"
#include "wavecomb/accel/embree_hierarchy.h"
#include "wavecomb/accel/triangle_list.h"
#include "wavecomb/geometry/curve/bvh_nodes.h"
#include "wavecomb/scene/scene.h"

namespace wavecomb {
namespace {

template <uint32_t W>
struct PacketTypes;
template <>
struct PacketTypes<4> {
  using Ray = RTCRay4;
  using RayHit = RTCRayHit4;
};
template <>
struct PacketTypes<8> {
  using Ray = RTCRay8;
  using RayHit = RTCRayHit8;
};
template <>
struct PacketTypes<16> {
  using Ray = RTCRay16;
  using RayHit = RTCRayHit16;
};

/// Initialises `context` and returns the arguments of Embree's closest-hit queries, which refer to
/// this context.
RTCIntersectArguments intersect_arguments(QueryContext& context, const SceneView& scene,
                                          const PresenceKeys& keys, uint32_t first_world,
                                          uint32_t first_light, bool coherent) {
  rtcInitRayQueryContext(&context.base);
  context.scene = &scene;
  context.keys = &keys;
  context.first_world = first_world;
  context.first_light = first_light;
  RTCIntersectArguments args;
  rtcInitIntersectArguments(&args);
  args.flags = static_cast<RTCRayQueryFlags>(
      (coherent ? RTC_RAY_QUERY_FLAG_COHERENT : RTC_RAY_QUERY_FLAG_INCOHERENT) |
      RTC_RAY_QUERY_FLAG_INVOKE_ARGUMENT_FILTER);
  args.filter = closest_filter;
  args.context = &context.base;
  return args;
}

/// Sets the directions and times of a packet that starts at ray `base`.
void set_rays(QueryContext& context, const RaySpan& rays, size_t base) {
  context.dx = rays.dx + base;
  context.dy = rays.dy + base;
  context.dz = rays.dz + base;
  context.time = rays.time ? rays.time + base : nullptr;
}

uint32_t widest_packet(RTCDevice device) {
  if (rtcGetDeviceProperty(device, RTC_DEVICE_PROPERTY_NATIVE_RAY16_SUPPORTED)) return 16;
  if (rtcGetDeviceProperty(device, RTC_DEVICE_PROPERTY_NATIVE_RAY8_SUPPORTED)) return 8;
  return rtcGetDeviceProperty(device, RTC_DEVICE_PROPERTY_NATIVE_RAY4_SUPPORTED) ? 4 : 1;
}

/// Returns whether more than half of a scene's primitives are curve segments.
bool is_mostly_hair(const Scene& scene) {
  size_t segments = 0, all = 0;
  for (const Mesh& mesh : scene.meshes()) {
    all += mesh.primitive_count();
    if (CurveBvhNodes::supports(mesh)) segments += mesh.primitive_count();
  }
  return 2 * segments > all;
}

}  // namespace

/// State of the accelerator: the BVH, which accelerators of edited scenes may share, and a view of
/// the scene, from whose materials the opacity of surfaces is read.
struct EmbreeAccelerator::Impl {
  std::shared_ptr<const Scene> scene;
  std::shared_ptr<const EmbreeHierarchy> hierarchy;
  SceneView view;
  RTCScene top;
  uint32_t first_world, first_light;  ///< as in EmbreeHierarchy
  uint32_t native;                    ///< number of rays in the widest native packet
  /// List of triangles that replaces the BVH in small scenes. Null if the BVH is used.
  std::unique_ptr<const TriangleList> list;
  bool is_hair;  ///< whether most primitives are curve segments

  Impl(std::shared_ptr<const Scene> of, std::shared_ptr<const EmbreeHierarchy> built)
      : scene(std::move(of)),
        hierarchy(std::move(built)),
        view(scene->view()),
        top(hierarchy->top()),
        first_world(hierarchy->first_world()),
        first_light(hierarchy->first_light()),
        native(widest_packet(hierarchy->device())),
        list(hierarchy->rule() == HitRule::kList ? TriangleList::make(*scene) : nullptr),
        is_hair(is_mostly_hair(*scene)) {}

  /// Hits of a packet as reported by Embree, in arrays with one value per ray.
  struct PacketHits {
    const float* t;  ///< QueryContext::t
    const float *u, *v;
    const unsigned *prim, *geom, *inst;
  };
  /// Stores the hits of the first `n` rays of a packet in `out`, starting at index `base`. Converts
  /// Embree's ids to scene ids in a loop that compilers vectorise.
  void store_hits(const PacketHits& hits, const HitSpan& out, size_t base, size_t n) const {
    const auto [t, u, v, prim, geom, inst] = hits;
    for (size_t i = 0; i < n; ++i) {
      const bool instanced = inst[i] != RTC_INVALID_GEOMETRY_ID;
      const uint32_t top_id = instanced ? inst[i] : geom[i];
      const bool missed = geom[i] == RTC_INVALID_GEOMETRY_ID;
      const bool light = top_id >= first_light;
      out.t[base + i] = t[i];
      out.u[base + i] = u[i];
      out.v[base + i] = v[i];
      out.prim[base + i] = prim[i];
      out.geom[base + i] =
          light ? top_id - first_light : (instanced ? geom[i] : geom[i] - first_world);
      out.inst[base + i] = missed ? kNoHit : (light ? kLightShape : (instanced ? inst[i] : 0));
    }
  }

  void intersect_alone(const RaySpan& rays, const HitSpan& hits, bool coherent,
                       const PresenceKeys& keys) const {
    for (size_t i = 0; i < rays.size; ++i) {
      RTCRayHit rh{};
      QueryContext context;
      RTCIntersectArguments args =
          intersect_arguments(context, view, keys, first_world, first_light, coherent);
      set_rays(context, rays, i);
      rh.ray = load_ray(rays, i);
      rh.hit.geomID = RTC_INVALID_GEOMETRY_ID;
      rh.hit.instID[0] = RTC_INVALID_GEOMETRY_ID;
      context.t[0] = std::numeric_limits<float>::infinity();
      context.inst = rh.hit.instID;
      context.geom = &rh.hit.geomID;
      context.prim = &rh.hit.primID;
      rtcIntersect1(top, &rh, &args);
      store_hits({.t = context.t,
                  .u = &rh.hit.u,
                  .v = &rh.hit.v,
                  .prim = &rh.hit.primID,
                  .geom = &rh.hit.geomID,
                  .inst = &rh.hit.instID[0]},
                 hits, i, 1);
    }
  }

  template <uint32_t W, typename Ray>
  static void load_rays(Ray& ray, int* valid, const RaySpan& rays, size_t base, size_t n) {
    for (uint32_t i = 0; i < W; ++i) valid[i] = i < n ? -1 : 0;
    // The arrays of a `RaySpan` are padded, so all `W` values can be copied even if the packet has
    // fewer rays.
    std::memcpy(ray.org_x, rays.ox + base, 4 * W);
    std::memcpy(ray.org_y, rays.oy + base, 4 * W);
    std::memcpy(ray.org_z, rays.oz + base, 4 * W);
    std::memcpy(ray.dir_x, rays.dx + base, 4 * W);
    std::memcpy(ray.dir_y, rays.dy + base, 4 * W);
    std::memcpy(ray.dir_z, rays.dz + base, 4 * W);
    for (uint32_t i = 0; i < W; ++i) {
      ray.tnear[i] = 0.f;
      ray.time[i] = rays.time && i < n ? rays.time[base + i] : 0.f;
      ray.mask[i] = 0xffffffffu;
      ray.flags[i] = 0;
    }
    if (rays.tfar)
      std::memcpy(ray.tfar, rays.tfar + base, 4 * W);
    else
      for (uint32_t i = 0; i < W; ++i) ray.tfar[i] = std::numeric_limits<float>::infinity();
    if (rays.slot)
      std::memcpy(ray.id, rays.slot + base, 4 * W);
    else
      for (uint32_t i = 0; i < W; ++i) ray.id[i] = static_cast<unsigned>(base + i);
  }

  template <uint32_t W>
  void intersect_packets(const RaySpan& rays, const HitSpan& hits, bool coherent,
                         const PresenceKeys& keys) const {
    alignas(64) typename PacketTypes<W>::RayHit rh;
    QueryContext context;
    RTCIntersectArguments args =
        intersect_arguments(context, view, keys, first_world, first_light, coherent);
    alignas(64) int valid[W];
    context.inst = rh.hit.instID[0];
    context.geom = rh.hit.geomID;
    context.prim = rh.hit.primID;
    for (size_t base = 0; base < rays.size; base += W) {
      const size_t n = std::min<size_t>(W, rays.size - base);
      set_rays(context, rays, base);
      load_rays<W>(rh.ray, valid, rays, base, n);
      for (uint32_t i = 0; i < W; ++i) {
        rh.hit.geomID[i] = RTC_INVALID_GEOMETRY_ID;
        rh.hit.instID[0][i] = RTC_INVALID_GEOMETRY_ID;
        context.t[i] = std::numeric_limits<float>::infinity();
      }
      if constexpr (W == 16)
        rtcIntersect16(valid, top, &rh, &args);
      else if constexpr (W == 8)
        rtcIntersect8(valid, top, &rh, &args);
      else
        rtcIntersect4(valid, top, &rh, &args);
      store_hits({.t = context.t,
                  .u = rh.hit.u,
                  .v = rh.hit.v,
                  .prim = rh.hit.primID,
                  .geom = rh.hit.geomID,
                  .inst = rh.hit.instID[0]},
                 hits, base, n);
    }
  }

  template <uint32_t W>
  void occluded_packets(const RaySpan& rays, uint32_t* out, QueryContext& context,
                        RTCOccludedArguments& args) const {
    alignas(64) typename PacketTypes<W>::Ray ray;
    alignas(64) int valid[W];
    for (size_t base = 0; base < rays.size; base += W) {
      const size_t n = std::min<size_t>(W, rays.size - base);
      set_rays(context, rays, base);
      load_rays<W>(ray, valid, rays, base, n);
      if constexpr (W == 16)
        rtcOccluded16(valid, top, &ray, &args);
      else if constexpr (W == 8)
        rtcOccluded8(valid, top, &ray, &args);
      else
        rtcOccluded4(valid, top, &ray, &args);
      for (size_t i = 0; i < n; ++i) out[base + i] = ray.tfar[i] < 0.f ? 1 : 0;
    }
  }

  /// Returns the number of rays per packet, which is at most the native width. Embree would split
  /// wider packets and call filters with single rays, whose position in the packet is unknown. In
  /// scenes with moving instances, the result is 1, since Embree rounds the inverse transforms of
  /// moving instances differently for packets and for single rays. For incoherent rays in scenes of
  /// hair, the result is also 1, because the rays of a packet would soon traverse different BVH
  /// nodes.
  uint32_t packet(uint32_t width, bool coherent, const PresenceKeys& keys) const {
    const bool parts = is_hair && !coherent && !keys.object;
    return parts || view.motion.instances ? 1 : std::min(width, native);
  }

  static RTCRay load_ray(const RaySpan& rays, size_t i) {
    RTCRay ray{};
    ray.org_x = rays.ox[i];
    ray.org_y = rays.oy[i];
    ray.org_z = rays.oz[i];
    ray.dir_x = rays.dx[i];
    ray.dir_y = rays.dy[i];
    ray.dir_z = rays.dz[i];
    ray.tfar = rays.tfar ? rays.tfar[i] : std::numeric_limits<float>::infinity();
    ray.time = rays.time ? rays.time[i] : 0.f;
    ray.mask = 0xffffffffu;
    ray.id = rays.slot ? rays.slot[i] : static_cast<unsigned>(i);
    return ray;
  }
};

EmbreeAccelerator::EmbreeAccelerator(std::shared_ptr<const Scene> scene, uint32_t threads,
                                     HitRule rule) {
  auto hierarchy = std::make_shared<const EmbreeHierarchy>(*scene, rule, nullptr, threads);
  impl_ = std::make_unique<Impl>(std::move(scene), std::move(hierarchy));
}

EmbreeAccelerator::EmbreeAccelerator(std::shared_ptr<const Scene> edited,
                                     const EmbreeAccelerator& origin, uint32_t threads) {
  const Impl& before = *origin.impl_;
  std::shared_ptr<const EmbreeHierarchy> hierarchy = before.hierarchy;
  const bool may_differ = edited->material_part() != before.scene->material_part() ||
                          edited->light_part() != before.scene->light_part();
  const bool is_moved = edited->geometry() != before.scene->geometry();
  if (is_moved || (may_differ && !hierarchy->fits(*edited)))
    hierarchy = std::make_shared<const EmbreeHierarchy>(*edited, hierarchy->rule(), hierarchy.get(),
                                                        threads);
  impl_ = std::make_unique<Impl>(std::move(edited), std::move(hierarchy));
}

EmbreeAccelerator::~EmbreeAccelerator() = default;

void EmbreeAccelerator::intersect(const RaySpan& rays, const HitSpan& hits, uint32_t width,
                                  bool coherent, const PresenceKeys& keys) const {
  if (impl_->list)
    return impl_->list->intersect(impl_->view, rays, hits, impl_->packet(width, coherent, keys),
                                  keys);
  coherent = coherent && !impl_->view.has_motion;
  switch (impl_->packet(width, coherent, keys)) {
    case 16:
      return impl_->intersect_packets<16>(rays, hits, coherent, keys);
    case 8:
      return impl_->intersect_packets<8>(rays, hits, coherent, keys);
    case 4:
      return impl_->intersect_packets<4>(rays, hits, coherent, keys);
    default:
      break;
  }
  impl_->intersect_alone(rays, hits, coherent, keys);
}

void EmbreeAccelerator::occluded(const RaySpan& rays, uint32_t* occluded, uint32_t width,
                                 bool coherent, const PresenceKeys& keys) const {
  if (impl_->list)
    return impl_->list->occluded(impl_->view, rays, occluded, impl_->packet(width, coherent, keys),
                                 keys);
  QueryContext context;
  rtcInitRayQueryContext(&context.base);
  context.scene = &impl_->view;
  context.keys = &keys;
  context.first_world = impl_->first_world;
  RTCOccludedArguments args;
  rtcInitOccludedArguments(&args);
  args.flags = coherent ? RTC_RAY_QUERY_FLAG_COHERENT : RTC_RAY_QUERY_FLAG_INCOHERENT;
  args.context = &context.base;
  switch (impl_->packet(width, coherent, keys)) {
    case 16:
      return impl_->occluded_packets<16>(rays, occluded, context, args);
    case 8:
      return impl_->occluded_packets<8>(rays, occluded, context, args);
    case 4:
      return impl_->occluded_packets<4>(rays, occluded, context, args);
    default:
      break;
  }
  for (size_t i = 0; i < rays.size; ++i) {
    set_rays(context, rays, i);
    RTCRay ray = Impl::load_ray(rays, i);
    rtcOccluded1(impl_->top, &ray, &args);
    occluded[i] = ray.tfar < 0.f ? 1 : 0;
  }
}

bool EmbreeAccelerator::has_list() const {
  return impl_->list != nullptr;
}

size_t EmbreeAccelerator::bytes() const {
  return impl_->hierarchy->bytes();
}

uint32_t EmbreeAccelerator::native_width() const {
  return impl_->native;
}

RTCSceneTy* EmbreeAccelerator::embree_scene() const {
  return impl_->top;
}

}  // namespace wavecomb
