// SPDX-License-Identifier: Apache-2.0
/// Gaussian splats (Kerbl et al., "3D Gaussian Splatting", 2023): storage and intersection.
///
/// The matrix W, the inverse of scale and orientation, transforms offsets from the splat's centre
/// to units of standard deviations. A ray o + t d hits a Gaussian splat where its response is
/// greatest, at t = -dot(W o, W d) / |W d|^2. The offset of this point is w = W o + t W d in
/// standard deviations. The splat is present with probability
///   alpha = opacity exp(-|w|^2 / 2),
/// and can be hit where |w| <= 3 and alpha >= 1/255. w is perpendicular to W d; the hit's (u, v)
/// are the components of w along the axes of gaussian_splat_frame().
#pragma once

#include <span>
#include <string>
#include <vector>

#include "wavecomb/core/math.h"
#include "wavecomb/core/vec.h"
#include "wavecomb/geometry/curve/intersect.h"

namespace wavecomb {

/// Creates rows of Gaussian splats. `scales`: 3 each, positive standard deviations along the axes;
/// `orientations`: quaternions w, x, y, z of any nonzero length. Throws Error that begins with
/// `name` if array sizes do not match or values are invalid.
std::vector<GaussianSplatRow> make_gaussian_splat_rows(std::span<const float> scales,
                                                       std::span<const float> orientations,
                                                       std::span<const float> opacities,
                                                       const std::string& name);

/// Returns the radii of bounding spheres of the visible extent of Gaussian splats.
std::vector<float> gaussian_splat_radii(std::span<const GaussianSplatRow> rows);

/// Throws Error that begins with `name` if arrays of Gaussian splats do not match or are not
/// finite.
void check_gaussian_splats(const Mesh& mesh, const std::string& name);

/// Returns the half extents of the bounding box of a Gaussian splat's visible extent.
Vec3<float> gaussian_splat_extent(const GaussianSplatRow& row);

/// Adds the hit of a ray on a Gaussian splat centred at `centre` if 0 < t <= tfar.
void intersect_gaussian_splat(const GaussianSplatRow& row, const Vec3<float>& centre,
                              const CurveRay& ray, float tfar, CurveHits& hits);

/// Returns the probability that a Gaussian splat is present at (u, v).
inline float gaussian_splat_alpha(const GaussianSplatRow& row, float u, float v) {
  return row.opacity * exp(-0.5f * (u * u + v * v));
}

/// Axes of the hit coordinates (u, v). The axes are orthonormal and perpendicular to e, the unit
/// ray direction in units of standard deviations.
template <typename F>
struct GaussianSplatFrame {
  Vec3<F> x, y;
};

/// Returns the axes of hit coordinates for the ray direction e. The axes are discontinuous at a
/// pole, which is chosen not to coincide with a coordinate axis.
template <typename F>
inline GaussianSplatFrame<F> gaussian_splat_frame(const Vec3<F>& e) {
  const Vec3<F> pole(F(0.36f), F(0.48f), F(0.8f));
  const Vec3<F> side = cross(pole, e);
  const Vec3<F> x = side * F(1.f / sqrt(max(length_squared(side), F(1e-20f))));
  return {x, cross(e, x)};
}

}  // namespace wavecomb
