// SPDX-License-Identifier: Apache-2.0
/// Validation of meshes of curves or points.
#pragma once

#include <string>

#include "wavecomb/geometry/mesh/mesh.h"

namespace wavecomb {

/// Throws an `Error` whose message begins with `name` if array sizes, control points or radii are
/// invalid.
void check_curves(const Mesh& mesh, const std::string& name);

/// Returns the MeshFlags of a mesh of curves or points, except the flags of texture coordinates.
uint32_t curve_flags(const Mesh& mesh);

}  // namespace wavecomb
