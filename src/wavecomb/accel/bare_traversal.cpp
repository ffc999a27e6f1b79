// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/accel/bare_traversal.h"

#include <embree4/rtcore.h>

#include <algorithm>
#include <cstring>
#include <limits>

namespace wavecomb {
namespace {

constexpr float kUnbounded = std::numeric_limits<float>::infinity();

/// Embree's ray type and query functions for packets of `W` rays.
template <uint32_t W>
struct Packet;
template <>
struct Packet<1> {
  using RayHit = RTCRayHit;
  static void intersect(const int*, RTCScene s, RayHit* r, RTCIntersectArguments* a) {
    rtcIntersect1(s, r, a);
  }
  static void occluded(const int*, RTCScene s, RTCRay* r, RTCOccludedArguments* a) {
    rtcOccluded1(s, r, a);
  }
};
template <>
struct Packet<4> {
  using RayHit = RTCRayHit4;
  static constexpr auto intersect = &rtcIntersect4;
  static constexpr auto occluded = &rtcOccluded4;
};
template <>
struct Packet<8> {
  using RayHit = RTCRayHit8;
  static constexpr auto intersect = &rtcIntersect8;
  static constexpr auto occluded = &rtcOccluded8;
};
template <>
struct Packet<16> {
  using RayHit = RTCRayHit16;
  static constexpr auto intersect = &rtcIntersect16;
  static constexpr auto occluded = &rtcOccluded16;
};

/// Returns a pointer to the first element of an Embree ray member, which is a scalar for single
/// rays and an array for packets.
template <typename T>
T* first(T& x) {
  return &x;
}
template <typename T, size_t N>
T* first(T (&x)[N]) {
  return x;
}

/// Sets the ray members that Embree does not modify during a query.
template <uint32_t W, typename Ray>
void prepare(Ray& ray) {
  for (uint32_t i = 0; i < W; ++i) {
    first(ray.tnear)[i] = 0.f;
    first(ray.mask)[i] = 0xffffffffu;
    first(ray.id)[i] = 0;
    first(ray.flags)[i] = 0;
  }
}

template <uint32_t W, typename Ray>
void load(Ray& ray, const RaySpan& rays, size_t base) {
  std::memcpy(first(ray.org_x), rays.ox + base, 4 * W);
  std::memcpy(first(ray.org_y), rays.oy + base, 4 * W);
  std::memcpy(first(ray.org_z), rays.oz + base, 4 * W);
  std::memcpy(first(ray.dir_x), rays.dx + base, 4 * W);
  std::memcpy(first(ray.dir_y), rays.dy + base, 4 * W);
  std::memcpy(first(ray.dir_z), rays.dz + base, 4 * W);
  if (rays.time)
    std::memcpy(first(ray.time), rays.time + base, 4 * W);
  else
    std::fill_n(first(ray.time), W, 0.f);
  if (rays.tfar)
    std::memcpy(first(ray.tfar), rays.tfar + base, 4 * W);
  else
    std::fill_n(first(ray.tfar), W, kUnbounded);
}

template <typename Arguments>
void query(Arguments& args, bool coherent) {
  args.flags = coherent ? RTC_RAY_QUERY_FLAG_COHERENT : RTC_RAY_QUERY_FLAG_INCOHERENT;
}

/// Calls `trace(base, n, valid)` for each packet of rays. `n` is the number of rays in the packet,
/// which is `W` except in the last packet. Returns the sum of the results of `trace`.
template <uint32_t W, typename Trace>
size_t for_each_packet(size_t size, Trace&& trace) {
  alignas(64) int valid[W];
  std::fill_n(valid, W, -1);
  size_t hits = 0;
  for (size_t base = 0; base < size; base += W) {
    const auto n = static_cast<uint32_t>(std::min<size_t>(W, size - base));
    for (uint32_t i = n; i < W; ++i) valid[i] = 0;
    hits += trace(base, n, valid);
  }
  return hits;
}

template <uint32_t W>
size_t intersect_all(RTCScene scene, const RaySpan& rays, bool coherent) {
  RTCIntersectArguments args;
  rtcInitIntersectArguments(&args);
  query(args, coherent);
  alignas(64) typename Packet<W>::RayHit rh{};
  prepare<W>(rh.ray);
  return for_each_packet<W>(rays.size, [&](size_t base, uint32_t n, const int* valid) {
    load<W>(rh.ray, rays, base);
    std::fill_n(first(rh.hit.geomID), W, RTC_INVALID_GEOMETRY_ID);
    std::fill_n(first(rh.hit.instID[0]), W, RTC_INVALID_GEOMETRY_ID);
    Packet<W>::intersect(valid, scene, &rh, &args);
    size_t hits = 0;
    for (uint32_t i = 0; i < n; ++i) hits += first(rh.hit.geomID)[i] != RTC_INVALID_GEOMETRY_ID;
    return hits;
  });
}

template <uint32_t W>
size_t occluded_all(RTCScene scene, const RaySpan& rays, bool coherent) {
  RTCOccludedArguments args;
  rtcInitOccludedArguments(&args);
  query(args, coherent);
  alignas(64) decltype(Packet<W>::RayHit::ray) ray{};
  prepare<W>(ray);
  return for_each_packet<W>(rays.size, [&](size_t base, uint32_t n, const int* valid) {
    load<W>(ray, rays, base);
    Packet<W>::occluded(valid, scene, &ray, &args);
    size_t hits = 0;
    for (uint32_t i = 0; i < n; ++i) hits += first(ray.tfar)[i] < 0.f;
    return hits;
  });
}

}  // namespace

BareTraversal::BareTraversal(std::shared_ptr<const Scene> scene, uint32_t threads)
    : accel_(std::move(scene), threads, HitRule::kEmbree) {}

size_t BareTraversal::intersect(const RaySpan& rays, uint32_t width, bool coherent) const {
  const RTCScene scene = accel_.embree_scene();
  switch (width) {
    case 16:
      return intersect_all<16>(scene, rays, coherent);
    case 8:
      return intersect_all<8>(scene, rays, coherent);
    case 4:
      return intersect_all<4>(scene, rays, coherent);
    default:
      return intersect_all<1>(scene, rays, coherent);
  }
}

size_t BareTraversal::occluded(const RaySpan& rays, uint32_t width, bool coherent) const {
  const RTCScene scene = accel_.embree_scene();
  switch (width) {
    case 16:
      return occluded_all<16>(scene, rays, coherent);
    case 8:
      return occluded_all<8>(scene, rays, coherent);
    case 4:
      return occluded_all<4>(scene, rays, coherent);
    default:
      return occluded_all<1>(scene, rays, coherent);
  }
}

}  // namespace wavecomb
