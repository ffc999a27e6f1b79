// SPDX-License-Identifier: Apache-2.0
/// Rays against the round shapes of lights.
#pragma once

#include "wavecomb/scene/light_data.h"
#include "wavecomb/scene/scene.h"

namespace wavecomb {

/// A box around a sphere, disk or cylinder light, a little larger than the shape.
Bounds round_light_bounds(const LightRecord& light);

/// Distance along dir to a sphere, disk or cylinder light, in units of |dir|; 0 where it is not
/// ahead. From inside a sphere, its far side is met. One ray at a time and in double precision, so
/// that a hit is the same whatever the rays beside it are: Embree's own spheres and discs round
/// differently in packets and alone.
float intersect_round_light(const LightRecord& light, const float (&origin)[3],
                            const float (&dir)[3]);

}  // namespace wavecomb
