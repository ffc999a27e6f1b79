// SPDX-License-Identifier: Apache-2.0
/// What the emission and the opacity of a triangle are on the whole, for the choice among lights.
#pragma once

#include "wavecomb/scene/scene_parts.h"

namespace wavecomb {

/// Whether rays may be aimed at what a material emits: where its graph reads nothing that only a
/// path knows that has met the surface. What is not aimed at is seen by paths that meet it.
bool can_aim_at(const Material& material, const GraphSet& graphs);

/// Sets the radiance of a triangle, whose corners are set, to what `material` emits on it: as it
/// is where it is constant, else about its mean (by the mean of the whole texture, and that of a
/// few points where a graph drives it). 0 for what rays may not be aimed at.
void set_mean_emission(const SceneGeometry& geometry, const SceneMaterials& materials,
                       const Material& material, EmissiveTriangle& triangle);

/// Sets the opacity of a triangle likewise: 1 where it is not presence, never 0 where it varies.
void set_mean_opacity(const SceneGeometry& geometry, const SceneMaterials& materials,
                      const Material& material, EmissiveTriangle& triangle);

}  // namespace wavecomb
