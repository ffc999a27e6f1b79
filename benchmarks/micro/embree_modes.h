// SPDX-License-Identifier: Apache-2.0
/// Embree scenes built and traced in several modes, to measure their cost and accuracy.
#pragma once

#include <algorithm>
#include <cstring>
#include <limits>
#include <vector>

#include "wavecomb/accel/embree_filters.h"

namespace wavecomb::micro {

inline constexpr float kUnbounded = std::numeric_limits<float>::infinity();

/// Triangles of a mesh, with vertex positions and vertex indices.
struct Soup {
  std::vector<float> positions;  ///< 3 per vertex
  std::vector<uint32_t> indices;
};

/// Options for building and tracing an Embree scene.
struct Mode {
  const char* name;
  bool robust = true, filter = true;
  uint32_t width = 16;
  const char* device = nullptr;  ///< configuration string of the Embree device
  RTCBuildQuality quality = RTC_BUILD_QUALITY_MEDIUM;
  bool merged = false;          ///< whether all meshes are merged into one Embree geometry
  bool only_triangles = false;  ///< whether scenes are built for triangles only
  bool coherent = false;
};

/// An Embree scene that was built with the options of a `Mode`.
class Built {
 public:
  Built(const std::vector<Soup>& soups, const Mode& mode) : mode_(mode) {
    device_ = rtcNewDevice(mode.device);
    top_ = rtcNewScene(device_);
    unsigned flags = mode.robust ? RTC_SCENE_FLAG_ROBUST : RTC_SCENE_FLAG_NONE;
    if (mode.filter) flags |= RTC_SCENE_FLAG_FILTER_FUNCTION_IN_ARGUMENTS;
    rtcSetSceneFlags(top_, static_cast<RTCSceneFlags>(flags));
    rtcSetSceneBuildQuality(top_, mode.quality);
    std::vector<Soup> merged(1);
    for (const Soup& soup : soups) {
      const auto first = static_cast<uint32_t>(merged[0].positions.size() / 3);
      for (uint32_t i : soup.indices) merged[0].indices.push_back(first + i);
      merged[0].positions.insert(merged[0].positions.end(), soup.positions.begin(),
                                 soup.positions.end());
    }
    for (const Soup& soup : mode.merged ? merged : soups) attach(soup);
    rtcCommitScene(top_);
  }
  ~Built() {
    rtcReleaseScene(top_);
    rtcReleaseDevice(device_);
  }
  Built(const Built&) = delete;
  Built& operator=(const Built&) = delete;

  /// Returns the number of rays that hit something.
  size_t trace(const RaySpan& rays, bool shadow) const {
    switch (mode_.width) {
      case 16:
        return packets<16, RTCRayHit16>(rays, shadow, rtcIntersect16, rtcOccluded16);
      case 8:
        return packets<8, RTCRayHit8>(rays, shadow, rtcIntersect8, rtcOccluded8);
      default:
        return alone(rays, shadow);
    }
  }
  const Mode& mode() const { return mode_; }

 private:
  void attach(const Soup& soup) {
    RTCGeometry g = rtcNewGeometry(device_, RTC_GEOMETRY_TYPE_TRIANGLE);
    rtcSetGeometryBuildQuality(g, mode_.quality);
    void* p = rtcSetNewGeometryBuffer(g, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, 12,
                                      soup.positions.size() / 3);
    std::memcpy(p, soup.positions.data(), soup.positions.size() * 4);
    void* i = rtcSetNewGeometryBuffer(g, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3, 12,
                                      soup.indices.size() / 3);
    std::memcpy(i, soup.indices.data(), soup.indices.size() * 4);
    rtcCommitGeometry(g);
    rtcAttachGeometry(top_, g);
    rtcReleaseGeometry(g);
  }

  void ask(RTCIntersectArguments& closest, RTCOccludedArguments& any, QueryContext& context) const {
    rtcInitRayQueryContext(&context.base);
    rtcInitIntersectArguments(&closest);
    rtcInitOccludedArguments(&any);
    closest.context = any.context = &context.base;
    closest.flags = any.flags =
        mode_.coherent ? RTC_RAY_QUERY_FLAG_COHERENT : RTC_RAY_QUERY_FLAG_INCOHERENT;
    if (mode_.only_triangles)
      closest.feature_mask = any.feature_mask = static_cast<RTCFeatureFlags>(
          RTC_FEATURE_FLAG_TRIANGLE | RTC_FEATURE_FLAG_FILTER_FUNCTION_IN_ARGUMENTS);
    if (!mode_.filter) return;
    closest.filter = closest_filter;
    closest.flags =
        static_cast<RTCRayQueryFlags>(closest.flags | RTC_RAY_QUERY_FLAG_INVOKE_ARGUMENT_FILTER);
  }

  template <uint32_t W, typename RayHit, typename Intersect, typename Occluded>
  size_t packets(const RaySpan& rays, bool shadow, Intersect intersect, Occluded occluded) const {
    QueryContext context;
    RTCIntersectArguments closest;
    RTCOccludedArguments any;
    ask(closest, any, context);
    alignas(64) RayHit rh{};
    alignas(64) int valid[W];
    context.inst = rh.hit.instID[0];
    context.geom = rh.hit.geomID;
    context.prim = rh.hit.primID;
    std::fill_n(rh.ray.mask, W, 0xffffffffu);
    size_t hits = 0;
    for (size_t base = 0; base < rays.size; base += W) {
      const auto n = static_cast<uint32_t>(std::min<size_t>(W, rays.size - base));
      for (uint32_t i = 0; i < W; ++i) valid[i] = i < n ? -1 : 0;
      const float* from[6] = {rays.ox, rays.oy, rays.oz, rays.dx, rays.dy, rays.dz};
      float* to[6] = {rh.ray.org_x, rh.ray.org_y, rh.ray.org_z,
                      rh.ray.dir_x, rh.ray.dir_y, rh.ray.dir_z};
      for (int k = 0; k < 6; ++k) std::memcpy(to[k], from[k] + base, 4 * n);
      std::fill_n(rh.ray.tfar, W, kUnbounded);
      if (rays.tfar) std::memcpy(rh.ray.tfar, rays.tfar + base, 4 * n);
      if (shadow) {
        occluded(valid, top_, reinterpret_cast<decltype(RayHit::ray)*>(&rh.ray), &any);
        for (uint32_t i = 0; i < n; ++i) hits += rh.ray.tfar[i] < 0.f;
        continue;
      }
      std::fill_n(rh.hit.geomID, W, RTC_INVALID_GEOMETRY_ID);
      std::fill_n(rh.hit.instID[0], W, RTC_INVALID_GEOMETRY_ID);
      std::fill_n(context.t, 16, kUnbounded);
      intersect(valid, top_, &rh, &closest);
      for (uint32_t i = 0; i < n; ++i) hits += rh.hit.geomID[i] != RTC_INVALID_GEOMETRY_ID;
    }
    return hits;
  }

  size_t alone(const RaySpan& rays, bool shadow) const {
    QueryContext context;
    RTCIntersectArguments closest;
    RTCOccludedArguments any;
    ask(closest, any, context);
    RTCRayHit rh{};
    context.inst = rh.hit.instID;
    context.geom = &rh.hit.geomID;
    context.prim = &rh.hit.primID;
    rh.ray.mask = 0xffffffffu;
    size_t hits = 0;
    for (size_t i = 0; i < rays.size; ++i) {
      rh.ray.org_x = rays.ox[i];
      rh.ray.org_y = rays.oy[i];
      rh.ray.org_z = rays.oz[i];
      rh.ray.dir_x = rays.dx[i];
      rh.ray.dir_y = rays.dy[i];
      rh.ray.dir_z = rays.dz[i];
      rh.ray.tfar = rays.tfar ? rays.tfar[i] : kUnbounded;
      if (shadow) {
        rtcOccluded1(top_, &rh.ray, &any);
        hits += rh.ray.tfar < 0.f;
        continue;
      }
      rh.hit.geomID = rh.hit.instID[0] = RTC_INVALID_GEOMETRY_ID;
      context.t[0] = kUnbounded;
      rtcIntersect1(top_, &rh, &closest);
      hits += rh.hit.geomID != RTC_INVALID_GEOMETRY_ID;
    }
    return hits;
  }

  Mode mode_;
  RTCDevice device_;
  RTCScene top_;
};

/// Rays in columns.
struct Rays {
  std::vector<float> column[7];
  bool limited = false;

  void add(const RaySpan& rays) {
    const float* from[7] = {rays.ox, rays.oy, rays.oz, rays.dx, rays.dy, rays.dz, rays.tfar};
    limited = rays.tfar != nullptr;
    for (int k = 0; k < (limited ? 7 : 6); ++k)
      column[k].insert(column[k].end(), from[k], from[k] + rays.size);
  }
  RaySpan span() const {
    return {column[0].data(),
            column[1].data(),
            column[2].data(),
            column[3].data(),
            column[4].data(),
            column[5].data(),
            limited ? column[6].data() : nullptr,
            nullptr,
            column[0].size()};
  }
};

}  // namespace wavecomb::micro
