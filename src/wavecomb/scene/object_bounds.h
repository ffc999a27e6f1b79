// SPDX-License-Identifier: Apache-2.0
/// Bounds of meshes, instances and named objects.
#pragma once

#include <span>
#include <string_view>

#include "wavecomb/scene/scene.h"

namespace wavecomb {

/// Returns whether an object is at or below a prim: "/World/Forest[12]/Leaves" is below
/// "/World/Forest".
bool is_in_prim(std::string_view object, std::string_view prim);

/// Returns the bounds of a mesh in its local space, over all motion steps and with the radii of
/// curves and points.
Bounds mesh_bounds(const Mesh& mesh);

/// Extends `out` by the corners of a box of an instance, at all times of the shutter interval.
void add_instance_bounds(Bounds& out, const Bounds& box, const Instance& instance,
                         std::span<const MatrixStep> steps);

/// Returns the world bounds, over the whole shutter interval, of all meshes at or below a prim
/// (named as by ObjectNames). Returns empty bounds if no mesh is at or below the prim. The function
/// visits every object of the scene, so call it rarely.
Bounds object_bounds(const Scene& scene, std::string_view prim);

}  // namespace wavecomb
