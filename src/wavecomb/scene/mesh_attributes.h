// SPDX-License-Identifier: Apache-2.0
/// Attributes of meshes: checked, and as lanes read them.
#pragma once

#include <string>
#include <vector>

#include "wavecomb/scene/scene_parts.h"

namespace wavecomb {

/// Throws Error where attributes of a mesh do not fit it. `where` names the mesh, `names` are those
/// of the attributes that there are.
void check_attributes(const Mesh& mesh, const std::string& where,
                      const std::vector<std::string>& names);

/// Fills attribute_records and mesh_attributes from the meshes; leaves them empty where no mesh has
/// any.
void make_attribute_records(SceneGeometry& geometry);

}  // namespace wavecomb
