// SPDX-License-Identifier: Apache-2.0
/// Objects inside of absorbing glass.
#pragma once

#include <span>

#include "wavecomb/scene/scene_parts.h"

namespace wavecomb {

struct Light;
struct Material;

/// Whether an absorbing solid of glass holds an object, a part of one, or the centre of a light.
/// Light then passes through the glass on segments that do not end at its surface, so that paths
/// need to know what they are inside of (asks_for_interiors).
///
/// `groups`: meshes of group 0 are in world space. Uses the first shapes of meshes and positions in
/// mid-shutter. Tests vertices of curves, and of each triangle a few points of the part that is
/// within the bounds of the glass. Where that takes more than half a second the answer is true.
bool absorbing_glass_holds_objects(std::span<const Material> materials,
                                   std::span<const Mesh> meshes, std::span<const Group> groups,
                                   std::span<const Instance> instances,
                                   std::span<const MatrixStep> steps,
                                   std::span<const Light> lights);

}  // namespace wavecomb
