// SPDX-License-Identifier: Apache-2.0
/// Validation and packing of mesh attributes.
#pragma once

#include <string>
#include <vector>

#include "wavecomb/scene/scene_parts.h"

namespace wavecomb {

/// Throws Error if the number of values of an attribute does not match the mesh, or if a value is
/// not finite. `where` names the mesh in the message; `names` are the names of all attributes, by
/// id.
void check_attributes(const Mesh& mesh, const std::string& where,
                      const std::vector<std::string>& names);

/// Fills `attribute_records` and `mesh_attributes` from the meshes; leaves both empty if no mesh
/// has attributes.
void make_attribute_records(SceneGeometry& geometry);

}  // namespace wavecomb
