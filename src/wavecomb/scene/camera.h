// SPDX-License-Identifier: Apache-2.0
/// The camera as data.
#pragma once

#include <vector>

#include "wavecomb/core/affine.h"

namespace wavecomb {

/// A perspective thin-lens camera. It looks along -z of its own space, +x right, +y up
/// (UsdGeomCamera). Lengths are in scene units.
struct Camera {
  Affine to_world;
  /// Places at equal distances over the shutter, with straight lines between; none: it stands still
  /// at to_world. Two or more where it moves.
  std::vector<Affine> steps{};
  /// Window on the plane z = -1: x from window[0] to window[1], y from window[2] to window[3].
  float window[4] = {-0.5f, 0.5f, -0.5f, 0.5f};
  float lens_radius = 0;     ///< 0: pinhole
  float focus_distance = 1;  ///< along -z, > 0 where lens_radius > 0
  float near_clip = 0;       ///< along -z
  float far_clip = 1e30f;
};

}  // namespace wavecomb
