// SPDX-License-Identifier: Apache-2.0
/// A path tracer for tests that is simple enough to be obviously correct.
///
/// The naive integrator shares with production all functions without random decisions: ray
/// intersection, shading points, f |cos| of BSDFs, emission of lights and surfaces along a ray, and
/// light linking. The naive integrator shares no sampling with production. Directions are uniform
/// over the sphere (over the hemisphere for opaque programs), there is no light sampling and hence
/// no MIS, no Russian roulette, and the random number generator is a separate one.
///
///   L(x, wo) = Le + sum over delta lobes c L(x', wi)                    (each followed)
///                 + (2 or 4) pi / n sum over n uniform wi f |cos| L(x', wi)
///                 + sum over delta lights f |cos| E V                   (they have no density)
///                 + T L(x', -wo)               (straight transmission T, which is not a bounce)
///
/// Lights with multipliers, and lights that production finds only by light samples
/// (LightRecord::sampled_only: invisible shapes, shadow links), are evaluated along the same
/// uniform directions, whether or not other objects are in front of them. The visibility of these
/// lights is tested with their own shadow sets.
///
/// Beyond the first vertex of a path, textures are read with the footprint after a diffuse bounce.
/// Scenes with textured indirect light are therefore exact for diffuse surfaces only.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "wavecomb/scene/scene.h"

namespace wavecomb {

struct NaiveSettings {
  uint32_t width = 16, height = 16;
  uint32_t samples = 16;  ///< samples per pixel, uniform over the pixel
  uint32_t max_depth = 1;
  uint32_t directions = 1;  ///< uniform directions sampled at the first vertex; later vertices
                            ///< sample one
  /// Random numbers used to find delta lobes; 0 for scenes without delta lobes.
  uint32_t delta_tries = 0;
  uint64_t seed = 0;
  bool schlick_fresnel = false;
};

/// Returns radiance with the camera's exposure: rows from the top, RGB interleaved.
std::vector<double> render_naively(const std::shared_ptr<const Scene>& scene,
                                   const NaiveSettings& settings);

}  // namespace wavecomb
