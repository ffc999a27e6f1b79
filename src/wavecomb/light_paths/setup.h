// SPDX-License-Identifier: Apache-2.0
/// Light paths of a render: support by the scene, unit and filter of light splats
/// (docs/light-paths.md).
#pragma once

#include <cmath>
#include <cstdint>
#include <string>
#include <vector>

#include "wavecomb/core/encoding/fixed_point.h"
#include "wavecomb/core/settings.h"
#include "wavecomb/film/splats/light_splat_filter.h"
#include "wavecomb/scene/scene.h"

namespace wavecomb {

struct CameraSetup;

/// Number of light paths per camera path, averaged over the image: 2^exponent.
struct LightPathShare {
  int exponent = 0;

  float paths() const { return std::ldexp(1.f, exponent); }
  /// Returns the samples of each light path when pixels have `n` samples.
  uint32_t samples(uint32_t n) const {
    return exponent >= 0 ? n << exponent : (n + (1u << -exponent) - 1) >> -exponent;
  }
};

/// Returns the feature of the scene that does not work with light paths. Empty if there is none.
LightPathConflict light_path_conflict(const Scene& scene);
/// Throws Error if the scene has such a feature.
void check_light_paths(const Scene& scene, const Settings& settings);

/// Returns the mean radiance that the scene would have if it received the power of all its lights,
/// times the camera's exposure, rounded up to a power of two.
float scene_brightness(const Scene& scene);
/// Returns the fixed-point unit of light splats: scene_brightness() / 2^44. Splats thus keep at
/// least 20 bits of contributions above 2^-24 of that brightness, and reach up to 2^17 times the
/// brightness.
FixedPoint light_splat_unit(const Scene& scene);

/// Returns the filter that distributes contributions of light paths to the pixels of a render.
LightSplatFilter make_light_splat_filter(const CameraSetup& camera, const FilterTable& filter,
                                         const Region& rendered);

/// Enables light paths for the lights of `view`: sets the sphere around all surfaces, and the
/// distance from which paths of infinite lights start, in front of all light shapes.
void send_paths(const Scene& scene, LightView& view);

/// Returns whether any light of the scene emits light paths.
bool emits_paths(const Scene& scene);

/// Returns the names of the lights that emit no light paths. Camera paths find all of their light.
std::vector<std::string> lights_without_paths(const Scene& scene);

}  // namespace wavecomb
