// SPDX-License-Identifier: Apache-2.0
/// Mean emission and opacity of a triangle, which determine its selection probability as a light.
#pragma once

#include "wavecomb/scene/scene_parts.h"

namespace wavecomb {

/// Returns whether light sampling can aim at the emission of a material. The result is false if the
/// material's graph reads inputs that are known only when a path hits the surface. Only paths that
/// hit the surface find such emission.
bool can_aim_at(const Material& material, const GraphSet& graphs);

/// Sets the radiance of a triangle, whose corners must be set, to the emission of `material` if the
/// emission is constant, otherwise to an estimate of its mean (from the mean of the whole texture,
/// or from evaluating a graph at a few points). Sets the radiance to 0 if light sampling cannot aim
/// at the material.
void set_mean_emission(const SceneGeometry& geometry, const SceneMaterials& materials,
                       const Material& material, EmissiveTriangle& triangle);

/// Sets the opacity of a triangle to the opacity of `material` if this opacity is constant,
/// otherwise to a nonzero estimate of its mean. Sets the triangle's opacity to 1 if the material
/// does not use opacity as presence.
void set_mean_opacity(const SceneGeometry& geometry, const SceneMaterials& materials,
                      const Material& material, EmissiveTriangle& triangle);

}  // namespace wavecomb
