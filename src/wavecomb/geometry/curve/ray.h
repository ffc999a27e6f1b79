// SPDX-License-Identifier: Apache-2.0
/// Ray with a coordinate system, for intersection with curves.
#pragma once

#include <cstring>

#include "wavecomb/geometry/curve/bezier.h"

namespace wavecomb {

/// Ray with an orthonormal frame whose z axis is along the ray. The frame is stored in double
/// precision and rounded to float.
struct CurveRay {
  CurveRay(const float (&from)[3], const float (&along)[3]) : space(from, along) {
    std::memcpy(origin, from, sizeof(origin));
    std::memcpy(dir, along, sizeof(dir));
    length = static_cast<float>(space.length);
    const curve_math::V* rows[3] = {&space.x, &space.y, &space.z};
    for (int k = 0; k < 3; ++k) {
      const Vec3<float> row = curve_math::narrow(*rows[k]);
      axis[k][0] = row.x;
      axis[k][1] = row.y;
      axis[k][2] = row.z;
    }
  }

  /// Returns whether origin and direction of this ray are bit-identical to the given vectors.
  bool is(const float (&from)[3], const float (&along)[3]) const {
    return std::memcmp(origin, from, sizeof(origin)) == 0 &&
           std::memcmp(dir, along, sizeof(dir)) == 0;
  }

  curve_math::RaySpace space;
  float origin[3], dir[3];
  float axis[3][3];
  float length;  ///< length of the ray direction
};

}  // namespace wavecomb
