// SPDX-License-Identifier: Apache-2.0
/// What a render needs for paths that start at lights (docs/light-paths.md).
#pragma once

#include <string>
#include <vector>

#include "wavecomb/core/fixed_point.h"
#include "wavecomb/core/settings.h"
#include "wavecomb/integrate/wave.h"
#include "wavecomb/scene/scene.h"

namespace wavecomb {

/// Throws Error where the scene's camera is of a kind that such paths do not find.
void check_light_paths(const Scene& scene);

/// The unit of splats: that of light of which the scene as a whole would be as bright as its lights
/// have power, over 2^44. So splats keep some 20 bits and more from 2^-24 of that brightness up,
/// and reach 2^17 of it.
FixedPoint splat_unit(const Scene& scene);

/// Lets the lights of `view` send paths: towards all surfaces, from before all shapes of lights.
void send_paths(const Scene& scene, LightView& view);

/// Names of the lights that send none: camera paths find all of their light.
std::vector<std::string> lights_without_paths(const Scene& scene);

}  // namespace wavecomb
