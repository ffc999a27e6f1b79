// SPDX-License-Identifier: Apache-2.0
/// Objects and lights inside of glass.
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

/// By material: whether it is searched for contents.
using Glasses = std::vector<bool>;
Glasses glasses_of(std::span<const Material> materials,
                   const std::function<bool(const Material&)>& test);

/// Whether a closed mesh of glass holds an object or a part of one. Light then passes through the
/// glass on segments that do not end at its surface, so that paths need to know what they are
/// inside of if it absorbs (asks_for_interiors).
///
/// Uses the first shapes of meshes and positions in mid-shutter. Tests vertices of curves, and of
/// each triangle a few points of the part that is within the bounds of the glass. Where that takes
/// more than half a second the answer is true.
bool glass_holds_objects(const Glasses& glasses, const PlacedObjects& objects);
/// Whether it holds the centre of a light.
bool glass_holds_lights(const Glasses& glasses, const PlacedObjects& objects,
                        std::span<const Light> lights);

}  // namespace wavecomb
