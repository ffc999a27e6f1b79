// SPDX-License-Identifier: Apache-2.0
/// Setup of light paths for a render (docs/light-paths.md). The functions check that the scene
/// supports light paths, and determine the unit and the filter of light splats.
#pragma once

#include <cmath>
#include <cstdint>
#include <string>
#include <vector>

#include "wavecomb/core/encoding/fixed_point.h"
#include "wavecomb/core/settings.h"
#include "wavecomb/film/splats/light_splat_filter.h"
#include "wavecomb/scene/scene_view.h"

namespace wavecomb {

class Scene;
struct CameraSetup;

/// Number of light paths per camera path, averaged over the image: 2^exponent.
struct LightPathShare {
  int exponent = 0;

  float paths() const { return std::ldexp(1.f, exponent); }
  /// Returns the number of samples of each light path if each pixel has `n` samples.
  uint32_t samples(uint32_t n) const {
    return exponent >= 0 ? n << exponent : (n + (1u << -exponent) - 1) >> -exponent;
  }
};

/// Returns a feature of the scene that light paths do not support; the result is empty if there is
/// none.
LightPathConflict light_path_conflict(const Scene& scene);
/// Throws Error if the scene has a feature that light paths do not support.
void check_light_paths(const Scene& scene, const Settings& settings);

/// Returns an estimate of the scene's mean radiance times the camera's exposure, rounded up to a
/// power of two. The estimate assumes that all light power arrives at the scene's surfaces.
float scene_brightness(const Scene& scene);
/// Returns the fixed-point unit of light splats: scene_brightness() / 2^44. Splats therefore keep
/// at least 20 bits of contributions above 2^-24 times the scene brightness, and can represent up
/// to 2^17 times the brightness.
FixedPoint light_splat_unit(const Scene& scene);

/// Returns the filter that distributes contributions of light paths to the pixels of a render.
/// `one_pixel` is Settings::splats_to_one_pixel().
LightSplatFilter make_light_splat_filter(const CameraSetup& camera, const FilterTable& filter,
                                         const Region& rendered, bool one_pixel = false);

/// Enables light paths for the lights of `view`: sets the bounding sphere of all surfaces, and the
/// distance from its centre at which light paths of infinite lights start. A sphere with this
/// radius also contains all light shapes.
void send_paths(const Scene& scene, LightView& view);

/// Returns whether any light of the scene emits light paths.
bool emits_paths(const Scene& scene);

/// Returns the names of the lights that emit no light paths. Only camera paths sample the emission
/// of these lights.
std::vector<std::string> lights_without_paths(const Scene& scene);

}  // namespace wavecomb
