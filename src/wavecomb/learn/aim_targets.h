// SPDX-License-Identifier: Apache-2.0
/// Where paths from lights should be aimed, by what some of them brought to the picture.
#pragma once

#include <span>

#include "wavecomb/scene/light_aim.h"

namespace wavecomb {

/// Of a path from a light: the first place it met, and the luminance that it brought after a bounce
/// at least. What its first vertex shows to the camera, light samples find as well.
struct AimLesson {
  float x = 0, y = 0, z = 0;
  float worth = 0;
};

/// Spheres around the places that were worth something: boxes are halved as long as that makes the
/// worth denser, the one that gains most first. With W_k the worth of a box and A_k = r_k^2, a
/// mixture that chooses sphere k by W_k and is even within it is, over the same of one sphere, more
/// dense where light comes from by the exponential of
///   sum_k W_k log(W_k / A_k) - W log(W / A),
/// which is what halving is to add to: the maximum of likelihood. `scene_radius`: of the sphere
/// around all surfaces. Without any worth there are none.
LightAim aim_targets(std::span<const AimLesson> lessons, float scene_radius);

}  // namespace wavecomb
