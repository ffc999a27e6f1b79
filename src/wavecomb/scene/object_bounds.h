// SPDX-License-Identifier: Apache-2.0
/// Where meshes, instances and, by their names, objects are.
#pragma once

#include <span>
#include <string_view>

#include "wavecomb/scene/scene.h"

namespace wavecomb {

/// Bounds of a mesh in its own space, with the radii of curves and points, over all its steps.
Bounds mesh_bounds(const Mesh& mesh);

/// Adds the corners of a box that is in an instance, over the time that the shutter is open.
void add_placed(Bounds& out, const Bounds& box, const Instance& instance,
                std::span<const MatrixStep> steps);

/// World bounds, over the time that the shutter is open, of all meshes that are a prim or are in it
/// (ObjectNames): of "/World/Forest" the object "/World/Forest[12]/Leaves", too. Empty where there
/// are none. Looks at every object: for who asks once.
Bounds object_bounds(const Scene& scene, std::string_view prim);

}  // namespace wavecomb
