// SPDX-License-Identifier: Apache-2.0
/// Consistency checks for the arrays of a mesh.
#pragma once

#include <string>
#include <vector>

#include "wavecomb/geometry/mesh/mesh.h"

namespace wavecomb {

/// Throws Error naming the mesh if its arrays are inconsistent. `attribute_names`: by id.
void check_mesh(const Mesh& mesh, const std::vector<std::string>& attribute_names);

}  // namespace wavecomb
