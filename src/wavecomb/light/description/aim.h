// SPDX-License-Identifier: Apache-2.0
/// Target spheres of light paths.
#pragma once

#include <cstdint>

namespace wavecomb {

/// Target spheres of light paths (docs/light-paths.md, "Aiming"). With probability `even`, a light
/// path starts with the emission distribution of its light; with probability share[k], it starts
/// uniformly towards sphere k. These probabilities sum to 1.
struct LightAim {
  static constexpr uint32_t kMax = 16;

  uint32_t count = 0;
  float even = 1;
  float x[kMax] = {}, y[kMax] = {}, z[kMax] = {};
  float radius[kMax] = {};
  float share[kMax] = {};
  float end[kMax] = {};  ///< even + share[0] + ... + share[k]
};

}  // namespace wavecomb
