// SPDX-License-Identifier: Apache-2.0
/// Double-precision points and vectors for geometry processing.
#pragma once

#include <cmath>
#include <cstddef>
#include <span>

#include "wavecomb/core/vec3.h"

namespace wavecomb {

/// Point or vector in double precision.
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
/// Normalises a vector; (0, 0, 1) if its length is zero or not finite.
inline Point unit(const Point& p) {
  const double square = dot_of(p, p);
  if (!(square > 0) || !std::isfinite(square)) return {0, 0, 1};
  return p * (1 / std::sqrt(square));
}

/// Reads point i of an (n, 3) array.
inline Point point_at(std::span<const float> values, size_t i) {
  return {values[3 * i], values[3 * i + 1], values[3 * i + 2]};
}
/// Writes point i of an (n, 3) array.
inline void put(std::span<float> values, size_t i, const Point& p) {
  values[3 * i] = static_cast<float>(p.x);
  values[3 * i + 1] = static_cast<float>(p.y);
  values[3 * i + 2] = static_cast<float>(p.z);
}

}  // namespace wavecomb
