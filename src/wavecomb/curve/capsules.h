// SPDX-License-Identifier: Apache-2.0
/// Capsules side by side, and a ray.
#pragma once

#include "wavecomb/core/lanes.h"
#include "wavecomb/core/vec.h"

namespace wavecomb {

/// Where a ray along the z axis certainly passes by the spheres of a radius about the points of the
/// line from a to b, of which it may meet those with z_near <= z <= z_far. x and y of the ends may
/// be off by `rounding`; what z is off by, the caller takes from z_near and adds to z_far.
template <typename F>
inline Mask<F> passes_capsules(const Vec3<F>& a, const Vec3<F>& b, const F& radius,
                               const F& rounding, const F& z_near, const F& z_far) {
  // Whether both ends lie farther than the radius on one side of a line through the ray, along the
  // piece or square to it.
  const F cx = b.x - a.x, cy = b.y - a.y, length = sqrt(fma(cx, cx, F(cy * cy)));
  // The piece's direction is rounded as its ends are; where one of these is within the radius, the
  // other is no farther than the piece is long beyond that.
  const F reach = fma(radius, length, F(rounding * (length + radius)));
  const F beside = abs(fma(cx, a.y, F(-(cy * a.x))));
  const F along_a = fma(cx, a.x, F(cy * a.y)), along_b = fma(cx, b.x, F(cy * b.y));
  return (beside > reach) | (along_a > reach) | (along_b < -reach) |
         (max(a.z, b.z) + radius < z_near) | (min(a.z, b.z) - radius > z_far);
}

}  // namespace wavecomb
