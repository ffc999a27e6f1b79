// SPDX-License-Identifier: Apache-2.0
/// Motion of a camera ray's hit point across the image while the shutter is open.
#pragma once

#include "wavecomb/geometry/hit/surface.h"
#include "wavecomb/light/sampling/moving.h"
#include "wavecomb/path/camera/camera_connection.h"

namespace wavecomb {

/// Projects a point to the image at a shutter time, through the centre of the lens and without lens
/// distortion. Returns the position in pixels from the upper left corner. Latlong cameras are not
/// supported.
template <typename F>
inline Vec2<F> project_to_image(const CameraSetup& camera, const Vec3<F>& p, const F& time,
                                const Mask<F>& active) {
  const CameraSpace<F> space(camera, time, active);
  const Vec3<F> from = p - space.m.t;
  const F inverse_det = 1.f / space.det;
  F x = dot(space.x, from) * inverse_det, y = dot(space.y, from) * inverse_det;
  if (camera.projection == Projection::kPerspective) {
    const F depth = F(-dot(space.z, from)) * inverse_det;
    x = x / depth;
    y = y / depth;
  }
  return {F(x - camera.x0) * (1.f / camera.step_x), F(camera.y1 - y) * (1.f / camera.step_y)};
}

/// Returns the motion from the image position of point `first` at shutter open to the image
/// position of point `last` at shutter close, in pixels, x to the right and y up. Returns 0 if one
/// of the points has no image position.
template <typename F>
inline Vec2<F> screen_motion(const CameraSetup& camera, const Vec3<F>& first, const Vec3<F>& last,
                             const Mask<F>& active) {
  const Vec2<F> a = project_to_image<F>(camera, first, F(0.f), active);
  const Vec2<F> b = project_to_image<F>(camera, last, F(1.f), active);
  const F x = b.x - a.x, y = a.y - b.y;
  const Mask<F> valid = is_finite(x) & is_finite(y);
  return {select(valid, x, F(0.f)), select(valid, y, F(0.f))};
}

/// Returns the screen motion of a point of the light `light`, whose position at shutter time `time`
/// is `p`.
template <typename F>
inline Vec2<F> screen_motion_of_light(const LightView& lights, const CameraSetup& camera,
                                      const UInt<F>& light, const Vec3<F>& p, const F& time,
                                      const Mask<F>& active) {
  if (!lights.motions) return screen_motion<F>(camera, p, p, active);
  const Vec3<F> rests = light_pose<F>(lights, light, time, active).point_to_rest(p);
  const auto at = [&](float moment) {
    return light_pose<F>(lights, light, F(moment), active).point_to_world(rests);
  };
  return screen_motion<F>(camera, at(0.f), at(1.f), active);
}

/// Returns the screen motion of the surface point that a camera ray hits.
template <typename F>
[[gnu::noinline, gnu::cold]] Vec2<F> screen_motion_of_hit(const SceneView& scene,
                                                          const CameraSetup& camera, MeshHit<F> hit,
                                                          const Vec3<F>& dir,
                                                          const Mask<F>& active) {
  hit.time = F(0.f);
  const Vec3<F> first = setup_surface<F>(scene, hit, dir, false, false, active).p;
  hit.time = F(1.f);
  const Vec3<F> last = setup_surface<F>(scene, hit, dir, false, false, active).p;
  return screen_motion<F>(camera, first, last, active);
}

}  // namespace wavecomb
