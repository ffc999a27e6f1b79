// SPDX-License-Identifier: Apache-2.0
/// What a material can be told beside its textures, its graphs and the inputs of OpenPBR
/// (scene/openpbr_data.h), as a table: a row for each such member of Material. Checks, the
/// fingerprint, keywords and edits in Python, and calls of the sandbox follow from it. A new
/// parameter is a member of Material and of MaterialRecord, a row here, a line where records are
/// made (scene_materials.cpp), and its use.
#pragma once

#include <span>
#include <variant>

#include "wavecomb/scene/material_data.h"

namespace wavecomb {

/// Contract: lives as long as the program.
struct MaterialParameter {
  const char* name;  ///< keyword of add_material
  std::variant<float Material::*, Vec3<float> Material::*, bool Material::*> member;
};

/// All of them, in the order that fingerprints take them in: another row changes the fingerprint of
/// every scene, and so checkpoints of before start anew.
std::span<const MaterialParameter> material_table();

/// Runs visit(name, member) for each parameter whose member is a `Value`: float, Vec3<float>, bool.
template <typename Value, typename Visit>
void for_each_parameter(const Visit& visit) {
  for (const MaterialParameter& p : material_table())
    if (const auto* member = std::get_if<Value Material::*>(&p.member)) visit(p.name, *member);
}

}  // namespace wavecomb
