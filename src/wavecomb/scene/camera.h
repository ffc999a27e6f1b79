// SPDX-License-Identifier: Apache-2.0
/// The camera as data.
#pragma once

#include "wavecomb/core/affine.h"

namespace wavecomb {

/// A perspective thin-lens camera. It looks along -z of its own space, +x right, +y up
/// (UsdGeomCamera). Lengths are in scene units.
struct Camera {
  Affine to_world;
  /// Window on the plane z = -1: x from window[0] to window[1], y from window[2] to window[3].
  float window[4] = {-0.5f, 0.5f, -0.5f, 0.5f};
  float lens_radius = 0;     ///< 0: pinhole
  float focus_distance = 1;  ///< along -z, > 0 where lens_radius > 0
  float near_clip = 0;       ///< along -z
  float far_clip = 1e30f;
};

}  // namespace wavecomb
