// SPDX-License-Identifier: Apache-2.0
/// What a material can be told beside its textures, its graphs and the inputs of OpenPBR
/// (scene/openpbr_data.h), as a table: a row for each such member of Material, and for what
/// programs have to themselves (scene/programs.h). Checks, the fingerprint, keywords and edits in
/// Python, and calls of the sandbox follow from it. A new parameter of several programs is a member
/// of Material and of MaterialRecord, a row here, a line where records are made
/// (scene_materials.cpp), and its use; of one program alone, an entry of its row in
/// scene/programs.h and its use.
#pragma once

#include <span>
#include <type_traits>
#include <variant>

#include "wavecomb/scene/material_data.h"

namespace wavecomb {

/// A parameter that one program has to itself: number `index` of ProgramInfo::own.
struct OwnParameter {
  ProgramId program;
  size_t index;

  bool is_of(const Material& material) const { return material.program == program; }
  const ProgramParameter& info() const { return info_of(program).own[index]; }
};

/// Contract: lives as long as the program.
struct MaterialParameter {
  const char* name;  ///< keyword of add_material
  std::variant<float Material::*, Vec3<float> Material::*, bool Material::*, OwnParameter> place;

  /// Null of what materials of any program can be told.
  const OwnParameter* own() const { return std::get_if<OwnParameter>(&place); }
};

/// All of them, in the order that fingerprints take them in: another member changes the fingerprint
/// of every scene, and so checkpoints of before start anew. What programs have to themselves comes
/// last, and fingerprints take it in where it is not the default.
std::span<const MaterialParameter> material_table();

/// Runs visit(row, value) for each parameter of a material (const or not) that is a `Value`: float,
/// Vec3<float>, bool. What other programs have to themselves is left out.
template <typename Value, typename Object, typename Visit>
void for_each_parameter(Object& material, const Visit& visit) {
  for (const MaterialParameter& p : material_table()) {
    if (const auto* member = std::get_if<Value Material::*>(&p.place)) visit(p, material.**member);
    if constexpr (std::is_same_v<Value, float>)
      if (const OwnParameter* own = p.own(); own && own->is_of(material)) {
        float value = material.own_value(own->index);
        visit(p, value);
        if constexpr (!std::is_const_v<Object>) material.own[own->index] = value;
      }
  }
}

}  // namespace wavecomb
