// SPDX-License-Identifier: Apache-2.0
/// Points and directions in double precision, for making geometry.
#pragma once

#include <cmath>

#include "wavecomb/core/vec3.h"

namespace wavecomb {

using Point = Vec3<double>;

inline double dot_of(const Point& a, const Point& b) {
  return a.x * b.x + a.y * b.y + a.z * b.z;
}
inline Point cross_of(const Point& a, const Point& b) {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
inline double length_of(const Point& a) {
  return std::sqrt(dot_of(a, a));
}

}  // namespace wavecomb
