// SPDX-License-Identifier: Apache-2.0
/// Bezier curve segments in the coordinate system of a ray, in double precision.
#pragma once

#include <cmath>

#include "wavecomb/core/vec3.h"

namespace wavecomb::curve_math {

using V = Vec3<double>;

inline V vec(const float* p) {
  return {p[0], p[1], p[2]};
}
inline double dot_d(const V& a, const V& b) {
  return a.x * b.x + a.y * b.y + a.z * b.z;
}
inline V cross_d(const V& a, const V& b) {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
inline V widen(const Vec3<float>& a) {
  return {a.x, a.y, a.z};
}
inline Vec3<float> narrow(const V& a) {
  return {static_cast<float>(a.x), static_cast<float>(a.y), static_cast<float>(a.z)};
}

/// Coordinate system of a ray: a right-handed orthonormal frame whose origin is the ray origin and
/// whose z axis is along the ray.
struct RaySpace {
  V o, x, y, z;
  double
      length;  ///< length of the ray direction; a point at `z` has the ray parameter t = z / length

  RaySpace(const float (&origin)[3], const float (&dir)[3]) : o(vec(origin)) {
    const V d = vec(dir);
    length = std::sqrt(dot_d(d, d));
    z = d * (1 / length);
    const double sign = std::copysign(1.0, z.z), a = -1 / (sign + z.z), b = z.x * z.y * a;
    x = {1 + sign * z.x * z.x * a, sign * b, -sign * z.x};
    y = {b, sign + z.y * z.y * a, -z.y};
  }
  V vector(const V& v) const { return {dot_d(v, x), dot_d(v, y), dot_d(v, z)}; }
  /// Converts a point from world space to the coordinate system of the ray.
  V point(const V& p) const { return vector(p - o); }
  /// Converts a vector from the coordinate system of the ray to world space.
  V back(const V& v) const { return x * v.x + y * v.y + z * v.z; }
};

/// Control points and radii of a cubic Bezier segment, which may also represent a line.
struct Bezier {
  V p[4];
  double r[4];

  V at(double u) const { return mix(p, u); }
  double radius(double u) const { return mix(r, u); }
  V along(double u) const { return slope(p, u); }
  /// Derivative of the curve's radius with respect to u.
  double widening(double u) const { return slope(r, u); }

  template <typename T>
  static T mix(const T* c, double u) {
    const double w = 1 - u;
    return c[0] * (w * w * w) + c[1] * (3 * w * w * u) + c[2] * (3 * w * u * u) +
           c[3] * (u * u * u);
  }
  template <typename T>
  static T slope(const T* c, double u) {
    const double w = 1 - u;
    return (c[1] - c[0]) * (3 * w * w) + (c[2] - c[1]) * (6 * w * u) + (c[3] - c[2]) * (3 * u * u);
  }
  template <typename T>
  /// Replaces the end points `c[0]` and `c[1]` of a line by the four control points of a cubic
  /// curve.
  static void line(T* c) {
    c[3] = c[1];
    c[1] = c[0] + (c[3] - c[0]) * (1.0 / 3);
    c[2] = c[0] + (c[3] - c[0]) * (2.0 / 3);
  }
  /// Replaces the curve `c` by its first or second half (De Casteljau's algorithm). The result is
  /// bit-identical to the same half from split().
  template <typename T, typename S = double>
  static void keep_half(T* c, bool second, S half = 0.5) {
    const T a = (c[0] + c[1]) * half, m = (c[1] + c[2]) * half, b = (c[2] + c[3]) * half;
    const T am = (a + m) * half, mb = (m + b) * half, middle = (am + mb) * half;
    if (second) {
      c[0] = middle;
      c[1] = mb;
      c[2] = b;
    } else {
      c[1] = a;
      c[2] = am;
      c[3] = middle;
    }
  }
  /// Splits c into two halves by De Casteljau's algorithm.
  template <typename T>
  static void split(const T* c, T* a, T* b) {
    const T m = (c[1] + c[2]) * 0.5;
    a[0] = c[0];
    b[3] = c[3];
    a[1] = (c[0] + c[1]) * 0.5;
    b[2] = (c[2] + c[3]) * 0.5;
    a[2] = (a[1] + m) * 0.5;
    b[1] = (m + b[2]) * 0.5;
    a[3] = b[0] = (a[2] + b[1]) * 0.5;
  }
};

}  // namespace wavecomb::curve_math
