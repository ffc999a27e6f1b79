// SPDX-License-Identifier: Apache-2.0
/// Table of material parameters other than textures, graphs and the inputs of OpenPBR
/// (material/description/openpbr_inputs.h). Each such member of Material has a row, and so has each
/// parameter specific to one program (material/description/programs.h). Range checks, the scene
/// fingerprint, Python keywords and edits, and sandbox calls are derived from the table. To add a
/// parameter of several programs, add a member to Material and to MaterialRecord, a row here, a
/// line in scene_materials.cpp, which packs records, and the code that uses the parameter. To add a
/// parameter of one program, add an entry to the program's row in material/description/programs.h
/// and the code that uses it.
#pragma once

#include <span>
#include <type_traits>
#include <variant>

#include "wavecomb/material/description/material.h"

namespace wavecomb {

/// A parameter of one program only, at position `index` in ProgramInfo::own.
struct SpecificParameter {
  ProgramId program;
  size_t index;

  bool is_of(const Material& material) const { return material.program == program; }
  const ProgramParameter& info() const { return info_of(program).own[index]; }
};

/// Row of the table: a material parameter. Rows have static lifetime.
struct MaterialParameter {
  const char* name;  ///< keyword argument of SceneBuilder.add_material() in Python
  std::variant<float Material::*, Vec3<float> Material::*, bool Material::*, SpecificParameter>
      accessor;

  /// Returns the program and index of a program-specific parameter, or null for a member of
  /// Material.
  const SpecificParameter* own() const { return std::get_if<SpecificParameter>(&accessor); }
};

/// Returns all parameters in the order in which fingerprints hash them. A new member of Material
/// changes the fingerprint of every scene, so older checkpoints cannot be continued. Parameters
/// specific to a program come last, and are hashed only if they differ from the default.
std::span<const MaterialParameter> material_table();

/// Calls visit(row, value) for each parameter of type `Value` (float, Vec3<float> or bool).
/// `material` may be const. Parameters that are specific to another program are skipped.
template <typename Value, typename Object, typename Visit>
void for_each_parameter(Object& material, const Visit& visit) {
  for (const MaterialParameter& p : material_table()) {
    if (const auto* member = std::get_if<Value Material::*>(&p.accessor))
      visit(p, material.**member);
    if constexpr (std::is_same_v<Value, float>)
      if (const SpecificParameter* own = p.own(); own && own->is_of(material)) {
        float value = material.specific_value(own->index);
        visit(p, value);
        if constexpr (!std::is_const_v<Object>) material.own[own->index] = value;
      }
  }
}

}  // namespace wavecomb
