// SPDX-License-Identifier: Apache-2.0
/// Target spheres of light paths.
#pragma once

#include <cstdint>

namespace wavecomb {

/// Target spheres of light paths (docs/light-paths.md, "Aiming"). A path starts from the
/// distribution of its light with probability `even`, and uniformly through sphere k with
/// probability share[k]. These probabilities sum to 1.
struct LightAim {
  static constexpr uint32_t kMost = 16;

  uint32_t count = 0;
  float even = 1;
  float x[kMost] = {}, y[kMost] = {}, z[kMost] = {};
  float radius[kMost] = {};
  float share[kMost] = {};
  float end[kMost] = {};  ///< even + share[0] + ... + share[k]
};

}  // namespace wavecomb
