// SPDX-License-Identifier: Apache-2.0
/// Lambert's diffuse reflection and the two-sided frame that opaque lobes share.
#pragma once

#include "wavecomb/core/warp.h"

namespace wavecomb {

/// +1 or -1: what z is multiplied by to bring `wo` to the upper side. Opaque surfaces look the same
/// from behind, so their programs mirror wo and wi at the surface.
template <typename F>
inline F side_of(const Vec3<F>& wo) {
  return copysign(F(1.f), wo.z);
}
template <typename F>
inline Vec3<F> mirror_z(const Vec3<F>& w, const F& side) {
  return {w.x, w.y, w.z * side};
}

/// f cos = cos theta_i / pi of a white Lambertian; 0 below the surface. It is also the density of
/// square_to_cosine_hemisphere, so that a sample's weight is the albedo.
template <typename F>
inline F lambert_cos(const Vec3<F>& wi) {
  return cosine_hemisphere_pdf(wi.z);
}

}  // namespace wavecomb
