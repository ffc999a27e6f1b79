// SPDX-License-Identifier: Apache-2.0
/// Connections of points to the camera: the film position of a point, and the density with which
/// camera paths find it.
///
/// Let M be the linear part of the camera-to-world transform. A point at depth s is p = o + s M d',
/// where d' = (x, y, -1) and o is a point on the lens or, for an orthographic camera, on the camera
/// plane. A pixel covers the area A = step_x step_y of the window and has one camera path per
/// sample. Directions from o thus have the density |M d'|^3 / (|det M| A) over solid angle, and a
/// surface at p, viewed at an angle with cosine cos, has the density G cos over its area, with
///   G = |M d'| / (|det M| A s^2);   orthographic:   |M d'| / (|det M| A).
/// Both camera rays and connections sample the lens uniformly, so the density of lens points
/// cancels. For a latlong camera d' is a unit vector, and a pixel covers the solid angle
/// cos(latitude) A, so
///   G = |M d'| / (|det M| A s^2 cos(latitude)).
#pragma once

#include "wavecomb/path/camera/camera_ray.h"

namespace wavecomb {

/// Camera-to-world transform and the rows of its inverse, multiplied by the determinant.
template <typename F>
struct CameraSpace {
  MatrixLanes<F> m;
  Vec3<F> x, y, z;
  F det;

  CameraSpace(const CameraSetup& camera, const F& time, const Mask<F>& active)
      : m(camera_transform<F>(camera, time, active)) {
    const Vec3<F> a(m.row[0].x, m.row[1].x, m.row[2].x), b(m.row[0].y, m.row[1].y, m.row[2].y),
        c(m.row[0].z, m.row[1].z, m.row[2].z);
    x = cross(b, c);
    y = cross(c, a);
    z = cross(a, b);
    det = dot(c, z);
  }
  /// Returns a point in camera space, given its offset from the camera's position in world space.
  Vec3<F> local(const Vec3<F>& from) const {
    const F inverse_det = 1.f / det;
    return {F(dot(x, from) * inverse_det), F(dot(y, from) * inverse_det),
            F(dot(z, from) * inverse_det)};
  }
};

/// Returns the distance of a point in camera space from the polar axis of a latlong camera.
template <typename F>
inline F from_axis(const Vec3<F>& q) {
  return sqrt(fma(q.x, q.x, F(q.z * q.z)));
}

/// Returns the density G of a point at depth s and at distance `stretch` * s from the lens.
/// `spread` is s or, for a latlong camera, the distance of the point from the axis through the
/// poles.
template <typename F>
inline F camera_density(const CameraSetup& camera, const F& det, const F& stretch, const F& s,
                        const F& spread) {
  const F pixel = abs(det) * (camera.step_x * camera.step_y);
  const F density = stretch / pixel;
  return camera.projection == Projection::kOrthographic ? density : F(density / F(s * spread));
}

/// Returns 1 / G for the point `p` that a camera ray along the unit direction `d` hits, or 0 if `p`
/// is outside the camera's clipping range.
template <typename F>
inline F inverse_camera_density(const CameraSetup& camera, const F& time, const Vec3<F>& p,
                                const Vec3<F>& d, const Mask<F>& active) {
  const CameraSpace<F> space(camera, time, active);
  const Vec3<F> from = p - space.m.t;
  F s = -dot(space.z, from) / space.det;
  F stretch = F(-space.det) / dot(space.z, d), spread = s;
  if (camera.projection == Projection::kLatlong) [[unlikely]] {
    const Vec3<F> q = space.local(from);
    s = length(q);
    stretch = length(from) / s;
    spread = from_axis<F>(q);
  }
  const F inverse = 1.f / camera_density<F>(camera, space.det, stretch, s, spread);
  return select(is_finite(inverse) & (s > 0.f) & (stretch > 0.f), inverse, F(0.f));
}

/// Connection of a point to the lens of the camera.
template <typename F>
struct CameraConnection {
  Vec3<F> to;  ///< start of the camera ray to the point: on the lens, or on the near clipping plane
  F x, y;      ///< film position in pixels from the upper left corner
  F density;   ///< G
  Mask<F> valid;
};

/// Connects the point `p` to the camera. `u` and `v` in [0, 1) sample the point on the lens. If a
/// latlong image shows a point several times, this function returns only one of the positions, and
/// LightSplatFilter adds the others.
template <typename F>
inline CameraConnection<F> connect_to_camera(const CameraSetup& camera, const Vec3<F>& p,
                                             const F& u, const F& v, const F& time,
                                             const Mask<F>& active) {
  const CameraSpace<F> space(camera, time, active);
  const Vec3<F> from = p - space.m.t;
  const Vec3<F> q = space.local(from);
  const bool is_all_round = camera.projection == Projection::kLatlong;
  const F s = is_all_round ? length(q) : F(-q.z);
  const Mask<F> ahead = active & (s > 0.f);
  const F inverse_s = 1.f / select(ahead, s, F(1.f));
  const bool is_parallel = camera.projection == Projection::kOrthographic;
  Vec2<F> lens{F(0.f), F(0.f)};
  float focus = 0;  // 1 / distance
  if (camera.lens_radius > 0) {
    lens = aperture_point<F>(camera, u, v);
    focus = 1.f / camera.focus_distance;
  }
  // d' and o. The window position is d' + lens / focus_distance. For an orthographic camera, it is
  // o minus the offset by the lens.
  detail::LocalRay<F> ray;
  F wx, wy, spread = s;
  if (is_all_round) [[unlikely]] {
    spread = from_axis<F>(q);
    ray.d = q * inverse_s;
    ray.o = Vec3<F>(F(0.f));
    wx = atan2(q.x, F(-q.z));
    wy = atan2(q.y, spread);
  } else if (is_parallel) {
    ray.d = {F(-lens.x * focus), F(-lens.y * focus), F(-1.f)};
    ray.o = {fma(F(-s), ray.d.x, q.x), fma(F(-s), ray.d.y, q.y), F(0.f)};
    wx = ray.o.x - lens.x;
    wy = ray.o.y - lens.y;
  } else {
    ray.d = {F(F(q.x - lens.x) * inverse_s), F(F(q.y - lens.y) * inverse_s), F(-1.f)};
    ray.o = {lens.x, lens.y, F(0.f)};
    wx = fma(lens.x, F(focus), ray.d.x);
    wy = fma(lens.y, F(focus), ray.d.y);
  }
  F near(camera.near_clip), far(camera.far_clip);
  if (!camera.clip_planes.empty()) detail::clip<F>(camera, ray, near, far);
  const Vec3<F> start = fma(ray.d, near, ray.o);
  const auto world = [&](const Vec3<F>& a) {
    return Vec3<F>(dot(space.m.row[0], a), dot(space.m.row[1], a), dot(space.m.row[2], a));
  };
  CameraConnection<F> c;
  c.to = world(start) + space.m.t;
  c.x = F(wx - camera.x0) * (1.f / camera.step_x);
  c.y = F(camera.y1 - wy) * (1.f / camera.step_y);
  c.density = camera_density<F>(camera, space.det, length(world(ray.d)), s, spread);
  c.valid = ahead & (s > near) & (s < far) & (c.density > 0.f) & is_finite(c.density);
  return c;
}

}  // namespace wavecomb
