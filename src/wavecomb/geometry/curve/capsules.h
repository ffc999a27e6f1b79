// SPDX-License-Identifier: Apache-2.0
/// Test of a ray against several capsules, one per SIMD lane.
#pragma once

#include "wavecomb/core/lanes/lanes.h"
#include "wavecomb/core/vec.h"

namespace wavecomb {

/// Returns a mask of the lanes in which a ray along the z axis is certain to miss the capsule. A
/// capsule is the union of spheres of radius `radius` around the points of the line from `a` to
/// `b`. Only hits with z_near <= z <= z_far are considered. `rounding` bounds the rounding error of
/// the x and y coordinates of a and b. The caller must extend the interval from z_near to z_far by
/// the rounding error of z.
template <typename F>
inline Mask<F> passes_capsules(const Vec3<F>& a, const Vec3<F>& b, const F& radius,
                               const F& rounding, const F& z_near, const F& z_far) {
  // Separating-axis test in the xy plane, in the direction of the capsule's axis and perpendicular
  // to this axis. The ray misses the capsule if both ends of the capsule are on the same side of
  // the ray and their distances exceed the radius.
  const F cx = b.x - a.x, cy = b.y - a.y, length = sqrt(fma(cx, cx, F(cy * cy)));
  // The computed direction of the axis is affected by the rounding errors of both ends. If the
  // distance of one end is at most the radius, the distance of the other end is at most the radius
  // plus the axis length, which bounds the rounding error of the products.
  const F reach = fma(radius, length, F(rounding * (length + radius)));
  const F separation = abs(fma(cx, a.y, F(-(cy * a.x))));
  const F along_a = fma(cx, a.x, F(cy * a.y)), along_b = fma(cx, b.x, F(cy * b.y));
  return (separation > reach) | (along_a > reach) | (along_b < -reach) |
         (max(a.z, b.z) + radius < z_near) | (min(a.z, b.z) - radius > z_far);
}

}  // namespace wavecomb
