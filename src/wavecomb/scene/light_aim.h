// SPDX-License-Identifier: Apache-2.0
/// Where paths from lights are aimed, as data.
#pragma once

#include <cstdint>

namespace wavecomb {

/// Spheres that paths from lights are aimed at (docs/light-paths.md, "Aiming"): with the
/// probability `even` a path starts as its light alone would have it, with share[k] evenly through
/// sphere k. They add up to 1.
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
