// SPDX-License-Identifier: Apache-2.0
/// Ray intersection with the emitting side of a light's shape, by textbook formulas in double
/// precision.
#pragma once

#include <cmath>

#include "wavecomb/light/description/light_records.h"
#include "wavecomb/light/kinds/kinds.h"

namespace wavecomb {

struct Double3n {
  double x, y, z;
};

inline Double3n of(const float* v) {
  return {v[0], v[1], v[2]};
}
inline Double3n of(const Vec3<float>& v) {
  return {v.x, v.y, v.z};
}
inline Double3n operator-(const Double3n& a, const Double3n& b) {
  return {a.x - b.x, a.y - b.y, a.z - b.z};
}
inline Double3n along(const Double3n& o, const Double3n& d, double t) {
  return {o.x + t * d.x, o.y + t * d.y, o.z + t * d.z};
}
inline double dot3(const Double3n& a, const Double3n& b) {
  return a.x * b.x + a.y * b.y + a.z * b.z;
}

/// Returns the smaller solution t > 0 of a t^2 + 2 b t + c = 0, or 0 if there is none. Only rays
/// from outside enter the light's shape.
inline double entry(double a, double b, double c) {
  const double root2 = b * b - a * c;
  if (!(a > 0) || !(root2 > 0) || !(c > 0)) return 0;
  const double t = (-b - std::sqrt(root2)) / a;
  return t > 0 ? t : 0;
}

/// Returns the distance at which the ray o + t d hits the emitting side of the light, or 0. `d` is
/// a unit vector.
inline double meets(const LightRecord& light, const Vec3<float>& origin,
                    const Vec3<float>& direction) {
  const Double3n o = of(origin), d = of(direction), p = of(light.p), u = of(light.u),
                 v = of(light.v), n = of(light.n), from = o - p;
  const auto kind = static_cast<LightKind>(light.kind);
  if (kind == LightKind::kRect || kind == LightKind::kDisk) {
    const double facing = -dot3(d, n);
    const double t = dot3(from, n) / facing;
    if (!(facing > 0) || !(t > 0)) return 0;
    // h = a u + b v, solved by the normal equations.
    const Double3n h = along(o, d, t) - p;
    const double uu = dot3(u, u), uv = dot3(u, v), vv = dot3(v, v), hu = dot3(h, u),
                 hv = dot3(h, v), det = uu * vv - uv * uv;
    const double a = (hu * vv - hv * uv) / det, b = (hv * uu - hu * uv) / det;
    const bool inside =
        kind == LightKind::kRect ? a >= 0 && a <= 1 && b >= 0 && b <= 1 : a * a + b * b <= 1;
    return inside ? t : 0;
  }
  const double r = light.radius;
  if (kind == LightKind::kSphere) return entry(dot3(d, d), dot3(d, from), dot3(from, from) - r * r);
  if (kind == LightKind::kCylinder) {
    // Perpendicular to the axis u. Both ends of the cylinder are open, and its inside does not
    // emit.
    const double uu = dot3(u, u), du = dot3(d, u), fu = dot3(from, u);
    const double t = entry(dot3(d, d) - du * du / uu, dot3(d, from) - du * fu / uu,
                           dot3(from, from) - fu * fu / uu - r * r);
    const double at = (fu + t * du) / uu;
    return t > 0 && at >= 0 && at <= 1 ? t : 0;
  }
  return 0;
}

/// Returns the distance at which a ray hits a triangle, which emits on both sides.
inline double meets(const TriangleLight& light, const Vec3<float>& origin,
                    const Vec3<float>& direction) {
  const Double3n o = of(origin), d = of(direction), p = of(light.p), u = of(light.u),
                 v = of(light.v), m = of(light.m);
  const double t = -dot3(o - p, m) / dot3(d, m);
  if (!(t > 0)) return 0;
  const Double3n h = along(o, d, t) - p;
  const double uu = dot3(u, u), uv = dot3(u, v), vv = dot3(v, v), hu = dot3(h, u), hv = dot3(h, v),
               det = uu * vv - uv * uv;
  const double a = (hu * vv - hv * uv) / det, b = (hv * uu - hu * uv) / det;
  return a >= 0 && b >= 0 && a + b <= 1 ? t : 0;
}

}  // namespace wavecomb
