// SPDX-License-Identifier: Apache-2.0
/// Gaussian splats (Kerbl and others, "3D Gaussian Splatting", 2023): how they are kept, and how
/// rays meet them.
///
/// W, the inverse of scales and orientation, takes offsets from the middle to standard deviations.
/// A ray o + t d meets the splat where its response is greatest: at t = -(Wo . Wd) / |Wd|^2, as far
/// from the middle as w = Wo + t Wd is long. It is there with the probability
///   alpha = opacity exp(-|w|^2 / 2),
/// and is met where |w| <= 3 and alpha >= 1/255. w is square to Wd; a hit is (u, v), its parts
/// along the axes of splat_frame.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "wavecomb/core/math.h"
#include "wavecomb/core/vec.h"
#include "wavecomb/curve/intersect.h"

namespace wavecomb {

/// Rows of splats. `scales`: 3 for each, standard deviations along its axes, positive;
/// `orientations`: quaternions w, x, y, z of any length but 0. Throws Error, which begins with
/// `name`, where arrays do not fit or values are no good.
std::vector<SplatRow> splat_rows(std::span<const float> scales, std::span<const float> orientations,
                                 std::span<const float> opacities, const std::string& name);

/// Radii of balls around what is met of splats.
std::vector<float> splat_radii(std::span<const SplatRow> rows);

/// Throws Error that begins with `name` where arrays of splats do not fit or are not finite.
void check_splats(const Mesh& mesh, const std::string& name);

/// The half lengths of a box around what is met of a splat.
Vec3<float> splat_reach(const SplatRow& row);

/// Adds the hit of a ray on a splat with its middle at `centre`, if 0 < t <= tfar.
void intersect_splat(const SplatRow& row, const Vec3<float>& centre, const CurveRay& ray,
                     float tfar, CurveHits& hits);

/// With which probability it is there at a hit.
inline float splat_alpha(const SplatRow& row, float u, float v) {
  return row.opacity * exp(-0.5f * (u * u + v * v));
}

/// Axes of hits: square to the unit vector e, in which the ray goes by standard deviations, and to
/// one another.
template <typename F>
struct SplatFrame {
  Vec3<F> x, y;
};

/// They turn all at once where e is along a direction that is no axis of anything.
template <typename F>
inline SplatFrame<F> splat_frame(const Vec3<F>& e) {
  const Vec3<F> pole(F(0.36f), F(0.48f), F(0.8f));
  const Vec3<F> side = cross(pole, e);
  const Vec3<F> x = side * F(1.f / sqrt(max(length_squared(side), F(1e-20f))));
  return {x, cross(e, x)};
}

}  // namespace wavecomb
