// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/scene/material_table.h"

namespace wavecomb {

std::span<const MaterialParameter> material_table() {
  using M = Material;
  static const MaterialParameter table[] = {
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
  return table;
}

}  // namespace wavecomb
