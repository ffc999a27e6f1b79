// SPDX-License-Identifier: Apache-2.0
/// Surfaces whose emission a value graph computes, as lights.
#pragma once

#include "wavecomb/scene/scene_parts.h"

namespace wavecomb {

/// Whether rays may be aimed at what a material emits: where its graph reads nothing that only a
/// path knows that has met the surface. What is not aimed at is seen by paths that meet it.
bool can_aim_at(const Material& material, const GraphSet& graphs);

/// Sets the radiance of a triangle, whose corners are set, to about the mean of what `graph` gives
/// over it.
void mean_graph_emission(const SceneGeometry& geometry, const SceneMaterials& materials,
                         uint32_t graph, EmissiveTriangle& triangle);

}  // namespace wavecomb
