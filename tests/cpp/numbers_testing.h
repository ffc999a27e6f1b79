// SPDX-License-Identifier: Apache-2.0
/// Constants and transforms that several test headers share. They declare these names again with
/// `using`, so that a test that uses two of the headers finds one entity.
#pragma once

#include <limits>

#include "wavecomb/core/affine.h"

namespace wavecomb::numbers_testing {

inline constexpr double kPiD = 3.14159265358979323846;
inline constexpr float kInf = std::numeric_limits<float>::infinity();
inline constexpr float kNan = std::numeric_limits<float>::quiet_NaN();

inline Affine translate(float x, float y, float z) {
  Affine a;
  a.t = {x, y, z};
  return a;
}
inline Affine scale(float x, float y, float z) {
  return {{{x, 0, 0}, {0, y, 0}, {0, 0, z}}, {0, 0, 0}};
}

}  // namespace wavecomb::numbers_testing
