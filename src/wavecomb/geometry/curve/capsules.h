// SPDX-License-Identifier: Apache-2.0
/// Test of a ray against several capsules in SIMD lanes.
#pragma once

#include "wavecomb/core/lanes/lanes.h"
#include "wavecomb/core/vec.h"

namespace wavecomb {

/// Returns the lanes whose capsules a ray along the z axis certainly misses. A capsule is the union
/// of spheres of `radius` around the points of the line from a to b; hits matter only within z_near
/// <= z <= z_far. `rounding` bounds the rounding error of the x and y coordinates of a and b. The
/// caller must extend the interval from z_near to z_far by the rounding error of z.
template <typename F>
inline Mask<F> passes_capsules(const Vec3<F>& a, const Vec3<F>& b, const F& radius,
                               const F& rounding, const F& z_near, const F& z_far) {
  // Separating-axis test in the xy plane, along the capsule's axis and perpendicular to it: the ray
  // misses the capsule if both ends lie on the same side, farther away than the radius.
  const F cx = b.x - a.x, cy = b.y - a.y, length = sqrt(fma(cx, cx, F(cy * cy)));
  // The computed axis direction has the rounding error of both ends. If one end is within the
  // radius, the other end is at most the axis length farther away, which bounds the rounding error
  // of the products.
  const F reach = fma(radius, length, F(rounding * (length + radius)));
  const F separation = abs(fma(cx, a.y, F(-(cy * a.x))));
  const F along_a = fma(cx, a.x, F(cy * a.y)), along_b = fma(cx, b.x, F(cy * b.y));
  return (separation > reach) | (along_a > reach) | (along_b < -reach) |
         (max(a.z, b.z) + radius < z_near) | (min(a.z, b.z) - radius > z_far);
}

}  // namespace wavecomb
