// SPDX-License-Identifier: Apache-2.0
/// Whether the arrays of a mesh hold together.
#pragma once

#include <string>
#include <vector>

#include "wavecomb/scene/mesh.h"

namespace wavecomb {

/// Throws Error that names the mesh. `attribute_names`: by id.
void check_mesh(const Mesh& mesh, const std::vector<std::string>& attribute_names);

}  // namespace wavecomb
