// SPDX-License-Identifier: Apache-2.0
/// How far what a camera ray has met moves about the picture while the shutter is open.
#pragma once

#include "wavecomb/integrate/camera_connection.h"
#include "wavecomb/light/moving.h"
#include "wavecomb/surface/surface.h"

namespace wavecomb {

/// Where a point shows at a time of the shutter, pixels from the upper left corner, by the middle
/// of a lens that does not distort. Not of latlong cameras.
template <typename F>
inline Vec2<F> place_in_picture(const CameraSetup& camera, const Vec3<F>& p, const F& time,
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

/// From where `first` shows when the shutter opens to where `last` does when it closes, in pixels,
/// x to the right and y up; 0 where one of them does not show.
template <typename F>
inline Vec2<F> screen_motion(const CameraSetup& camera, const Vec3<F>& first, const Vec3<F>& last,
                             const Mask<F>& active) {
  const Vec2<F> a = place_in_picture<F>(camera, first, F(0.f), active);
  const Vec2<F> b = place_in_picture<F>(camera, last, F(1.f), active);
  const F x = b.x - a.x, y = a.y - b.y;
  const Mask<F> good = is_finite(x) & is_finite(y);
  return {select(good, x, F(0.f)), select(good, y, F(0.f))};
}

/// The same of place `p` on lights `light` at `time`.
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

/// The same of the surface of a hit.
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
