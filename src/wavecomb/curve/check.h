// SPDX-License-Identifier: Apache-2.0
/// Whether a mesh of curves or points holds together.
#pragma once

#include <string>

#include "wavecomb/scene/mesh.h"

namespace wavecomb {

/// Throws Error that begins with `name` where array sizes, control points or radii are no good.
void check_curves(const Mesh& mesh, const std::string& name);

/// MeshFlags of a mesh of curves or points, but for its texture coordinates.
uint32_t curve_flags(const Mesh& mesh);

}  // namespace wavecomb
