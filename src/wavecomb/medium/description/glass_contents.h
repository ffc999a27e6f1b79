// SPDX-License-Identifier: Apache-2.0
/// Search for objects inside absorbing glass.
#pragma once

#include <span>

#include "wavecomb/scene/scene_parts.h"

namespace wavecomb {

struct Light;
struct Material;

/// Returns whether an absorbing glass solid contains an object, a part of one, or the centre of a
/// light. If so, light travels through the glass on segments that do not end at its surface, so
/// paths have to track a medium stack (asks_for_interiors).
///
/// Meshes of group 0 of `groups` are in world space. The test uses the first time step of mesh
/// shapes and instance transforms at mid-shutter. It tests vertices of curves, and a few points on
/// the part of each triangle that lies within the bounds of the glass. If it would take longer than
/// about half a second, it stops and returns true.
bool absorbing_glass_holds_objects(std::span<const Material> materials,
                                   std::span<const Mesh> meshes, std::span<const Group> groups,
                                   std::span<const Instance> instances,
                                   std::span<const MatrixStep> steps,
                                   std::span<const Light> lights);

}  // namespace wavecomb
