// SPDX-License-Identifier: Apache-2.0
/// Camera rays, and importance sampling of the pixel filter.
#pragma once

#include <array>
#include <vector>

#include "wavecomb/core/math.h"
#include "wavecomb/core/sampler.h"
#include "wavecomb/core/warp.h"
#include "wavecomb/film/filter.h"
#include "wavecomb/geometry/hit/motion.h"
#include "wavecomb/path/camera/lens.h"
#include "wavecomb/scene/camera/camera.h"

namespace wavecomb {

/// Width of the ray cone of camera rays, in pixels. A pixel averages many samples, so each sample
/// can filter textures over less than a pixel. A cone of one pixel, as in Igehy's ray
/// differentials, would blur textures more than renderers without ray cones do.
inline constexpr float kConeShare = 0.25f;

/// Camera with its window fitted to an image of width x height pixels, including overscan. A
/// latlong camera has no lens radius.
struct CameraSetup : Camera {
  std::vector<MatrixStep>
      transforms;        ///< transforms over the shutter interval, if the camera moves
  Vec3<float> backward;  ///< unit vector along the camera's z axis
  float x0, y1;          ///< upper left corner of the camera's window
  float step_x, step_y;  ///< size of a pixel on the camera's window
  const float* filter;   ///< FilterTable::offsets()
  bool has_far;          ///< whether a far plane or a clipping plane limits rays
  LensTable distortion;  ///< empty without lens distortion
  /// Time at which a rolling shutter exposes pixel (x, y):
  ///   a + b (x + 1/2) + c (y + 1/2) + duration t.
  std::array<float, 3> rolling{};

  /// `overscan` is the number of pixels beyond the window at each edge. Throws Error if the camera
  /// does not support overscan.
  CameraSetup(const Camera& camera, uint32_t width, uint32_t height, const FilterTable& table,
              uint32_t overscan = 0);
  bool moves() const { return !transforms.empty(); }
  /// Returns whether this is a pinhole camera: perspective, without lens radius, clipping planes or
  /// motion.
  bool is_pinhole() const {
    return projection == Projection::kPerspective && lens_radius == 0 && clip_planes.empty() &&
           !moves();
  }
};

/// Returns the shutter time of a path of pixel (x, y). `time` in [0, 1) is the sampled time of the
/// path within the exposure of the pixel.
template <typename F>
inline F camera_time(const CameraSetup& camera, const F& x, const F& y, const F& time) {
  if (camera.rolling_shutter == RollingShutter::kOff) return time;
  const auto [a, b, c] = camera.rolling;
  const F begin = fma(F(x + 0.5f), F(b), fma(F(y + 0.5f), F(c), F(a)));
  return clamp(F(fma(time, F(camera.rolling_duration), begin)), F(0.f), F(0x1.fffffep-1f));
}

/// Returns the camera-to-world transform at a shutter time.
template <typename F>
inline MatrixLanes<F> camera_transform(const CameraSetup& camera, const F& time,
                                       const Mask<F>& active) {
  const Affine& m = camera.to_world;
  if (!camera.moves())
    return {{Vec3<F>(m.row[0]), Vec3<F>(m.row[1]), Vec3<F>(m.row[2])}, Vec3<F>(m.t)};
  const auto segments = static_cast<uint32_t>(camera.transforms.size() - 1);
  return detail::MatrixPair<F>(camera.transforms.data(), UInt<F>(0u), UInt<F>(segments), time,
                               active)
      .matrix();
}

/// Returns the depth of a point along the camera's axis at a shutter time. For a latlong camera,
/// returns the distance of the point.
template <typename F>
inline F camera_depth(const CameraSetup& camera, const Vec3<F>& p, const F& time,
                      const Mask<F>& active) {
  if (camera.projection == Projection::kLatlong)
    return length(Vec3<F>(p - camera_transform<F>(camera, time, active).t));
  if (!camera.moves())
    return -dot(Vec3<F>(p - Vec3<F>(camera.to_world.t)), Vec3<F>(camera.backward));
  const MatrixLanes<F> m = camera_transform<F>(camera, time, active);
  return -dot(Vec3<F>(p - m.t), normalize(Vec3<F>(m.row[0].z, m.row[1].z, m.row[2].z)));
}

/// Returns the distance of a point from the camera's position at a shutter time.
template <typename F>
inline F camera_distance(const CameraSetup& camera, const Vec3<F>& p, const F& time,
                         const Mask<F>& active) {
  return length(Vec3<F>(p - camera_transform<F>(camera, time, active).t));
}

template <typename F>
struct CameraRay {
  Vec3<F> o, d;
  F width, spread;  ///< ray cone: width at the origin in scene units, and angle in radians
  F tfar;           ///< distance to the far plane
};

/// Returns the inverse CDF of the pixel filter at u, in pixels from the pixel's centre.
template <typename F>
inline F filter_offset(const float* table, const F& u, const Mask<F>& active) {
  const F x = u * static_cast<float>(FilterTable::kBins);
  const Int<F> bin = to_int<F>(x);
  const UInt<F> i(bin);
  const F a = gather<F>(table, i, active), b = gather<F>(table, i + 1u, active);
  return fma(F(b - a), F(x - F(bin)), a);
}

/// Returns the squared distance of the sample from the pixel's centre, in pixels.
template <typename F>
inline F centre_distance2(const CameraSetup& camera, const Sample4<F>& r, const Mask<F>& active) {
  const F dx = filter_offset<F>(camera.filter, r.x, active);
  const F dy = filter_offset<F>(camera.filter, r.y, active);
  return fma(dx, dx, F(dy * dy));
}

namespace detail {

/// Ray in camera space: points o + s d for s from near to far.
template <typename F>
struct LocalRay {
  Vec3<F> o, d;
};

/// Returns the ray through (x, y) of the window from the point of the lens at (u, v). The direction
/// d has d.z = -1 or, for a latlong camera, length 1.
template <typename F>
inline LocalRay<F> local_ray(const CameraSetup& camera, const F& x, const F& y, const F& u,
                             const F& v) {
  if (camera.projection == Projection::kLatlong) {
    const SinCos<F> lon = sincos_2pi<F>(F(x * kInv2Pi)), lat = sincos_2pi<F>(F(y * kInv2Pi));
    return {Vec3<F>(F(0.f)), {lon.sin * lat.cos, lat.sin, F(-lon.cos) * lat.cos}};
  }
  const bool is_parallel = camera.projection == Projection::kOrthographic;
  Vec3<F> o(F(0.f)), d{x, y, F(-1.f)};
  if (is_parallel) {
    o = {x, y, F(0.f)};
    d = {F(0.f), F(0.f), F(-1.f)};
  }
  if (camera.lens_radius > 0) {
    const Vec2<F> lens = aperture_point<F>(camera, u, v);
    const Vec3<F> p{lens.x, lens.y, F(0.f)};
    // The direction points from the lens to the point in focus, d * focus_distance, scaled back to
    // z = -1.
    d = {fma(p.x, F(-1.f / camera.focus_distance), d.x),
         fma(p.y, F(-1.f / camera.focus_distance), d.y), F(-1.f)};
    o = is_parallel ? Vec3<F>{o.x + p.x, o.y + p.y, F(0.f)} : p;
  }
  return {o, d};
}

/// Reduces [near, far] to the part of the ray that no clipping plane cuts off. If the clipping
/// planes cut off the whole ray, `far` is set to `near`.
template <typename F>
inline void clip(const CameraSetup& camera, const LocalRay<F>& ray, F& near, F& far) {
  for (const auto& [a, b, c, d] : camera.clip_planes) {
    const Vec3<F> normal{F(a), F(b), F(c)};
    const F at = dot(normal, ray.o) + d, slope = dot(normal, ray.d), crossing = -at / slope;
    near = select(slope > 0.f, max(near, crossing), near);
    far = select(slope < 0.f, min(far, crossing), far);
    far = select(Mask<F>(slope == 0.f) & Mask<F>(at < 0.f), near, far);
  }
  far = max(near, far);
}

}  // namespace detail

/// Returns the ray through the image position (fx, fy) in pixels, with y down from the top. `u` and
/// `v` sample the lens; `time` is the shutter time.
template <typename F>
inline CameraRay<F> ray_through(const CameraSetup& camera, const F& fx, const F& fy, const F& u,
                                const F& v, const F& time, const Mask<F>& active) {
  Vec2<F> at{fx, fy};
  if (!camera.distortion.empty()) [[unlikely]]
    at = undistorted<F>(camera.distortion, fx, fy, active);
  const detail::LocalRay<F> local =
      detail::local_ray<F>(camera, fma(at.x, F(camera.step_x), F(camera.x0)),
                           fma(at.y, F(-camera.step_y), F(camera.y1)), u, v);
  const Vec3<F>& d = local.d;
  F near(camera.near_clip), far(camera.far_clip);
  if (!camera.clip_planes.empty()) detail::clip<F>(camera, local, near, far);
  const Vec3<F> o = fma(d, near, local.o);
  const MatrixLanes<F> m = camera_transform<F>(camera, time, active);
  const Vec3<F> world{dot(m.row[0], d), dot(m.row[1], d), dot(m.row[2], d)};
  const F len = length(world);
  const bool is_parallel = camera.projection == Projection::kOrthographic;
  const float cone = kConeShare * camera.step_y;
  CameraRay<F> ray;
  ray.o = {dot(m.row[0], o) + m.t.x, dot(m.row[1], o) + m.t.y, dot(m.row[2], o) + m.t.z};
  ray.d = world * F(1.f / len);
  ray.width = F(is_parallel ? cone : 0.f);
  ray.spread = F(is_parallel ? 0.f : cone);
  ray.tfar = len * (far - near);
  return ray;
}

/// Returns the ray of pixel (x, y), with y down from the top, for the sample values `r` and a
/// shutter time.
template <typename F>
inline CameraRay<F> camera_ray(const CameraSetup& camera, const F& x, const F& y,
                               const Sample4<F>& r, const Mask<F>& active, const F& time = F(0.f)) {
  return ray_through<F>(camera, F(x + 0.5f + filter_offset<F>(camera.filter, r.x, active)),
                        F(y + 0.5f + filter_offset<F>(camera.filter, r.y, active)), r.z, r.w, time,
                        active);
}

}  // namespace wavecomb
