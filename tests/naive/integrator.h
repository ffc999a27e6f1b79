// SPDX-License-Identifier: Apache-2.0
/// A path tracer that is too simple to be wrong in the ways that production may be: test code.
///
/// It takes from production what is a value: what a ray hits, the surface there, f |cos| of a BSDF,
/// what a light or a surface emits along a ray, who is linked to whom. It shares nothing that is
/// sampled: directions are uniform over the sphere (or, of opaque programs, the hemisphere), there
/// is no light sampling, hence no MIS, and no roulette; the random numbers are its own.
///
///   L(x, wo) = Le + sum over delta lobes c L(x', wi)                    (each followed)
///                 + (2 or 4) pi / n sum over n uniform wi f |cos| L(x', wi)
///                 + sum over delta lights f |cos| E V                   (no density has them)
///
/// Lights with multipliers, and those that production finds by light samples alone
/// (LightRecord::sampled_only: hidden shapes, links of shadows) are looked for along the same
/// uniform directions, whatever else is there, and what is in their way is asked for with their own
/// set.
///
/// Beyond the first vertex textures are read as blurred as after a diffuse bounce, so that scenes
/// with textured indirect light are exact for diffuse surfaces only.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "wavecomb/scene/scene.h"

namespace wavecomb {

struct NaiveSettings {
  uint32_t width = 16, height = 16;
  uint32_t samples = 16;     ///< of each pixel, which is even over it
  uint32_t max_depth = 1;    ///< as Settings::max_depth
  uint32_t directions = 1;   ///< uniform ones at the first vertex; one later
  uint32_t delta_tries = 0;  ///< numbers by which delta lobes are looked for; 0: there are none
  uint64_t seed = 0;
  bool schlick_fresnel = false;
};

/// Radiance as the camera exposes it: rows from the top, rgb side by side.
std::vector<double> render_naively(const std::shared_ptr<const Scene>& scene,
                                   const NaiveSettings& settings);

}  // namespace wavecomb
