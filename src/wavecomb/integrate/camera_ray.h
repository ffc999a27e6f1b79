// SPDX-License-Identifier: Apache-2.0
/// Camera rays, and the pixel filter by importance sampling.
#pragma once

#include <vector>

#include "wavecomb/core/sampler.h"
#include "wavecomb/core/warp.h"
#include "wavecomb/film/filter.h"
#include "wavecomb/integrate/motion.h"
#include "wavecomb/scene/camera.h"

namespace wavecomb {

/// Width of a camera ray's cone in pixels. A pixel is the mean of many samples, each of which need
/// not blur as much as the pixel does; Igehy's full pixel shows, beside renderers without cones.
inline constexpr float kConeShare = 0.25f;

/// A camera with its window fitted to a picture of width x height pixels.
struct CameraSetup {
  Affine to_world;
  std::vector<MatrixStep> steps;  ///< over the shutter, where it moves
  Vec3<float> backward;           ///< unit vector along the camera's z axis
  float x0, y1;                   ///< window's upper left corner on the plane z = -1
  float step_x, step_y;           ///< window size of a pixel
  float lens_radius, focus_distance, near_clip, far_clip;
  const float* filter;  ///< FilterTable::offsets()
  bool has_far;         ///< the far plane cuts something off

  /// Widens the window to the picture's shape (UsdRender's expandAperture).
  CameraSetup(const Camera& camera, uint32_t width, uint32_t height, const FilterTable& table);
  bool moves() const { return !steps.empty(); }
};

/// Where the camera is at a time of the shutter.
template <typename F>
inline MatrixLanes<F> camera_place(const CameraSetup& camera, const F& time,
                                   const Mask<F>& active) {
  const Affine& m = camera.to_world;
  if (!camera.moves())
    return {{Vec3<F>(m.row[0]), Vec3<F>(m.row[1]), Vec3<F>(m.row[2])}, Vec3<F>(m.t)};
  const auto segments = static_cast<uint32_t>(camera.steps.size() - 1);
  return detail::MatrixPair<F>(camera.steps.data(), UInt<F>(0u), UInt<F>(segments), time, active)
      .matrix();
}

/// Distance of a point along the camera's axis, at a time of the shutter.
template <typename F>
inline F camera_depth(const CameraSetup& camera, const Vec3<F>& p, const F& time,
                      const Mask<F>& active) {
  if (!camera.moves())
    return -dot(Vec3<F>(p - Vec3<F>(camera.to_world.t)), Vec3<F>(camera.backward));
  const MatrixLanes<F> m = camera_place<F>(camera, time, active);
  return -dot(Vec3<F>(p - m.t), normalize(Vec3<F>(m.row[0].z, m.row[1].z, m.row[2].z)));
}

template <typename F>
struct CameraRay {
  Vec3<F> o, d;
  F spread;  ///< angle of the ray cone
  F tfar;    ///< distance to the far plane
};

/// Inverse CDF of the pixel filter at u, in pixels from the pixel's centre.
template <typename F>
inline F filter_offset(const float* table, const F& u, const Mask<F>& active) {
  const F x = u * static_cast<float>(FilterTable::kBins);
  const Int<F> bin = to_int<F>(x);
  const UInt<F> i(bin);
  const F a = gather<F>(table, i, active), b = gather<F>(table, i + 1u, active);
  return fma(F(b - a), F(x - F(bin)), a);
}

/// Squared distance of the sample from the pixel's centre, in pixels.
template <typename F>
inline F centre_distance2(const CameraSetup& camera, const Sample4<F>& r, const Mask<F>& active) {
  const F dx = filter_offset<F>(camera.filter, r.x, active);
  const F dy = filter_offset<F>(camera.filter, r.y, active);
  return fma(dx, dx, F(dy * dy));
}

/// The ray through a point of the picture, in pixels, y down from the top; `u`, `v` choose a point
/// of the lens. `time`: of the shutter.
template <typename F>
inline CameraRay<F> ray_through(const CameraSetup& camera, const F& fx, const F& fy, const F& u,
                                const F& v, const F& time, const Mask<F>& active) {
  Vec3<F> d{fma(fx, F(camera.step_x), F(camera.x0)), fma(fy, F(-camera.step_y), F(camera.y1)),
            F(-1.f)};
  Vec3<F> o(F(0.f));
  if (camera.lens_radius > 0) {
    const Vec2<F> lens = square_to_disk(u, v);
    o = {lens.x * camera.lens_radius, lens.y * camera.lens_radius, F(0.f)};
    // Through the point in focus: d * focus_distance, seen from the lens, scaled back to z = -1.
    d = {fma(o.x, F(-1.f / camera.focus_distance), d.x),
         fma(o.y, F(-1.f / camera.focus_distance), d.y), F(-1.f)};
  }
  o = fma(d, F(camera.near_clip), o);
  const MatrixLanes<F> m = camera_place<F>(camera, time, active);
  const Vec3<F> world{dot(m.row[0], d), dot(m.row[1], d), dot(m.row[2], d)};
  const F len = length(world);
  CameraRay<F> ray;
  ray.o = {dot(m.row[0], o) + m.t.x, dot(m.row[1], o) + m.t.y, dot(m.row[2], o) + m.t.z};
  ray.d = world * F(1.f / len);
  ray.spread = F(kConeShare * camera.step_y);
  ray.tfar = len * (camera.far_clip - camera.near_clip);
  return ray;
}

/// The ray of pixel (x, y), y down from the top, for the numbers of the camera's set and a time.
template <typename F>
inline CameraRay<F> camera_ray(const CameraSetup& camera, const F& x, const F& y,
                               const Sample4<F>& r, const Mask<F>& active, const F& time = F(0.f)) {
  return ray_through<F>(camera, F(x + 0.5f + filter_offset<F>(camera.filter, r.x, active)),
                        F(y + 0.5f + filter_offset<F>(camera.filter, r.y, active)), r.z, r.w, time,
                        active);
}

}  // namespace wavecomb
