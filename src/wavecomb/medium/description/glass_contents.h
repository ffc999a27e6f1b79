// SPDX-License-Identifier: Apache-2.0
/// Search for objects and lights inside glass.
#pragma once

#include <functional>
#include <span>
#include <vector>

#include "wavecomb/scene/scene_parts.h"

namespace wavecomb {

struct Light;
struct Material;

/// Objects of a scene. Meshes of group 0 are in world space.
struct PlacedObjects {
  std::span<const Mesh> meshes;
  std::span<const Group> groups;
  std::span<const Instance> instances;
  std::span<const MatrixStep> steps;
};

/// Predicate on materials. Returns true if closed meshes with the material are to be searched for
/// contents.
using Glasses = std::vector<bool>;
/// Calls `test` for each material and returns the results as flags.
Glasses glasses_of(std::span<const Material> materials,
                   const std::function<bool(const Material&)>& test);

/// Returns whether a closed mesh of glass contains an object or a part of one. If so, light travels
/// through the glass on segments that do not end at its surface, so paths have to track a medium
/// stack if the glass absorbs (needs_medium_stack).
///
/// The test uses meshes at their first time step, and instance transforms at mid-shutter. Tested
/// points are the vertices of curves, and a few points on the part of each triangle that lies
/// within the bounds of the glass. If the test would take longer than about half a second, the
/// function stops and returns true.
bool glass_holds_objects(const Glasses& glasses, const PlacedObjects& objects);
/// Returns whether a closed mesh of glass contains the centre of a light.
bool glass_holds_lights(const Glasses& glasses, const PlacedObjects& objects,
                        std::span<const Light> lights);

}  // namespace wavecomb
