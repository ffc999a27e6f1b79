// SPDX-License-Identifier: Apache-2.0
/// Storage of Gaussian splats (Kerbl et al., "3D Gaussian Splatting", 2023), and their intersection
/// with rays.
///
/// The matrix W inverts a splat's orientation and scale. It transforms offsets from the splat's
/// centre to units of standard deviations. A ray o + t d, with o relative to the centre, hits a
/// Gaussian splat where the Gaussian is largest along the ray, at t = -dot(W o, W d) / |W d|^2. The
/// offset of this point from the centre is w = W o + t W d in standard deviations. The splat is
/// present with probability
///   alpha = opacity exp(-|w|^2 / 2),
/// and can be hit where |w| <= 3 and alpha >= 1/255. The coordinates (u, v) of a hit are the
/// components of w along two axes perpendicular to W d, which `gaussian_splat_frame` returns.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "wavecomb/core/math.h"
#include "wavecomb/core/vec.h"
#include "wavecomb/geometry/curve/intersect.h"

namespace wavecomb {

/// Creates a row for each Gaussian splat. `scales` contains three positive standard deviations per
/// splat, and `orientations` a quaternion w, x, y, z of any nonzero length per splat. Throws an
/// `Error` whose message begins with `name` if array sizes do not match or values are invalid.
std::vector<GaussianSplatRow> make_gaussian_splat_rows(std::span<const float> scales,
                                                       std::span<const float> orientations,
                                                       std::span<const float> opacities,
                                                       const std::string& name);

/// Returns the radius of each Gaussian splat's bounding sphere, which contains all points where
/// rays can hit the splat.
std::vector<float> gaussian_splat_radii(std::span<const GaussianSplatRow> rows);

/// Throws an `Error` whose message begins with `name` if the array sizes of a mesh of Gaussian
/// splats do not match or values are not finite.
void check_gaussian_splats(const Mesh& mesh, const std::string& name);

/// Returns the half extents of a Gaussian splat's bounding box, which contains all points where
/// rays can hit the splat.
Vec3<float> gaussian_splat_extent(const GaussianSplatRow& row);

/// Adds the hit of a ray on a Gaussian splat with the centre `centre` to `hits`, if there is a hit
/// with 0 < t <= tfar.
void intersect_gaussian_splat(const GaussianSplatRow& row, const Vec3<float>& centre,
                              const CurveRay& ray, float tfar, CurveHits& hits);

/// Returns the probability that a ray hits a Gaussian splat at the coordinates (u, v).
inline float gaussian_splat_alpha(const GaussianSplatRow& row, float u, float v) {
  return row.opacity * exp(-0.5f * (u * u + v * v));
}

/// Axes of the hit coordinates (u, v) on a Gaussian splat. The axes are orthonormal and
/// perpendicular to the ray direction in units of standard deviations.
template <typename F>
struct GaussianSplatFrame {
  Vec3<F> x, y;
};

/// Returns the axes of the hit coordinates for `e`, the unit ray direction in units of standard
/// deviations. As a function of `e`, the axes are discontinuous at a single direction, which is not
/// a coordinate axis.
template <typename F>
inline GaussianSplatFrame<F> gaussian_splat_frame(const Vec3<F>& e) {
  const Vec3<F> pole(F(0.36f), F(0.48f), F(0.8f));
  const Vec3<F> side = cross(pole, e);
  const Vec3<F> x = side * F(1.f / sqrt(max(length_squared(side), F(1e-20f))));
  return {x, cross(e, x)};
}

}  // namespace wavecomb
