// SPDX-License-Identifier: Apache-2.0
/// Lambertian diffuse reflection, and mirroring of directions for the back faces of two-sided
/// programs.
#pragma once

#include "wavecomb/core/warp.h"

namespace wavecomb {

/// Returns the sign s = +1 or -1 for which (wo.x, wo.y, s wo.z) lies on the upper side. Opaque
/// surfaces look the same from both sides, so their programs mirror wo and wi.
template <typename F>
inline F side_of(const Vec3<F>& wo) {
  return copysign(F(1.f), wo.z);
}
template <typename F>
inline Vec3<F> mirror_z(const Vec3<F>& w, const F& side) {
  return {w.x, w.y, w.z * side};
}

/// f |cos theta_i| = cos theta_i / pi of a white Lambertian surface; 0 below the surface. This
/// value equals the density of square_to_cosine_hemisphere, so the weight of a sample is the
/// albedo.
template <typename F>
inline F lambert_cos(const Vec3<F>& wi) {
  return cosine_hemisphere_pdf(wi.z);
}

}  // namespace wavecomb
