// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/material/description/material_table.h"

#include <vector>

namespace wavecomb {
namespace {

std::vector<MaterialParameter> make_material_parameters() {
  using M = Material;
  std::vector<MaterialParameter> table = {
      {"base_color", &M::base_color},
      {"specular_color", &M::specular_color},
      {"emission", &M::emission},
      {"roughness", &M::roughness},
      {"metallic", &M::metallic},
      {"clearcoat", &M::clearcoat},
      {"clearcoat_roughness", &M::clearcoat_roughness},
      {"opacity", &M::opacity},
      {"ior", &M::ior},
      {"opacity_threshold", &M::opacity_threshold},
      {"conductor_eta", &M::conductor_eta},
      {"conductor_k", &M::conductor_k},
      {"specular_workflow", &M::specular_workflow},
      {"presence", &M::presence},
  };
  for (uint32_t id = 0; id < kProgramCount; ++id)
    for (size_t i = 0; i < kPrograms[id].own_count(); ++i)
      table.push_back({kPrograms[id].own[i].name, OwnParameter{static_cast<ProgramId>(id), i}});
  return table;
}

}  // namespace

std::span<const MaterialParameter> material_table() {
  static const std::vector<MaterialParameter> table = make_material_parameters();
  return table;
}

}  // namespace wavecomb
