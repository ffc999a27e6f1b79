// SPDX-License-Identifier: Apache-2.0
/// Target spheres of light paths.
#pragma once

#include <cstdint>

namespace wavecomb {

/// Target spheres of light paths (docs/light-paths.md, "Aiming"). With probability `even`, a light
/// path is sampled from the emission distribution of its light. With probability share[k], it is
/// aimed at sphere k, with a uniform distribution over the sphere. These probabilities sum to 1.
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
