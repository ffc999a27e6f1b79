// SPDX-License-Identifier: Apache-2.0
/// What a render needs for paths that start at lights (docs/light-paths.md).
#pragma once

#include <cmath>
#include <cstdint>
#include <string>
#include <vector>

#include "wavecomb/core/fixed_point.h"
#include "wavecomb/core/settings.h"
#include "wavecomb/film/splat_filter.h"
#include "wavecomb/scene/scene.h"

namespace wavecomb {

struct CameraSetup;

/// How many paths start at lights for each path of a pixel, over the number of the picture's
/// pixels: 2^exponent.
struct LightPathShare {
  int exponent = 0;

  float paths() const { return std::ldexp(1.f, exponent); }
  /// Samples of each number of such paths where pixels have `n`.
  uint32_t samples(uint32_t n) const {
    return exponent >= 0 ? n << exponent : (n + (1u << -exponent) - 1) >> -exponent;
  }
};

/// What of the scene such paths do not go with; empty: nothing.
LightPathRefusal light_path_refusal(const Scene& scene);
/// Throws Error where there is anything.
void check_light_paths(const Scene& scene, const Settings& settings);

/// The brightness, a power of two, that the scene as a whole would have of its lights' power.
float scene_brightness(const Scene& scene);
/// The unit of splats: that of light of which the scene as a whole would be as bright as its lights
/// have power, over 2^44. So splats keep some 20 bits and more from 2^-24 of that brightness up,
/// and reach 2^17 of it.
FixedPoint splat_unit(const Scene& scene);

/// How light that paths show to the camera counts for the pixels of a render.
SplatFilter splat_filter_of(const CameraSetup& camera, const FilterTable& filter,
                            const Region& rendered);

/// Lets the lights of `view` send paths: towards all surfaces, from before all shapes of lights.
void send_paths(const Scene& scene, LightView& view);

/// Whether any light of the scene may send paths.
bool sends_paths(const Scene& scene);

/// Names of the lights that send none: camera paths find all of their light.
std::vector<std::string> lights_without_paths(const Scene& scene);

}  // namespace wavecomb
