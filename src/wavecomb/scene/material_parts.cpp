// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/scene/material_parts.h"

#include <algorithm>

#include "wavecomb/graph/parameters.h"

namespace wavecomb {

uint32_t parts_of(const Material& m, const GraphSet& graphs) {
  const auto varies = [&](const char* parameter) {
    return graphs.drives(m.graph, graph_parameter(parameter));
  };
  const auto above_0 = [&](Input input, const char* parameter, float constant) {
    return constant != 0 || m.has_texture(input) || varies(parameter);
  };
  uint32_t parts = 0;
  const auto add = [&parts](Part part, bool shown) { parts |= shown ? part : 0u; };
  add(kVaries, m.graph != kNoGraph ||
                   std::any_of(m.textures.begin(), m.textures.end(),
                               [](const TextureUse& u) { return u.texture != kNoTexture; }));
  add(kGlows, m.emits());
  add(kMetals, m.specular_workflow || above_0(Input::kMetallic, "metallic", m.metallic));
  add(kCoats, above_0(Input::kClearcoat, "clearcoat", m.clearcoat));
  if (m.program == ProgramId::kPrincipled) {
    // What is presence is none of the BSDF's.
    const bool is_presence = m.opacity_threshold > 0 || (m.presence && m.needs_presence());
    add(kPasses, !is_presence && (m.opacity != 1 || m.opacity_varies()));
  }
  if (m.program == ProgramId::kOpenPbr) {
    const OpenPbr& o = m.openpbr;
    add(kPasses, o.transmission_weight != 0 || varies("transmission_weight"));
    add(kBacks, o.thin_walled && (o.subsurface_weight != 0 || varies("subsurface_weight")));
    add(kFuzzes, o.fuzz_weight != 0 || varies("fuzz_weight"));
    add(kFilms, o.film_weight != 0 || varies("film_weight"));
    add(kBrushes,
        o.anisotropy != 0 || o.rotation != 0 || varies("anisotropy") || varies("rotation"));
  }
  return parts;
}

uint32_t least_variant(ProgramId program, uint32_t parts) {
  for (uint32_t v = kProgramCount; v < kVariantCount; ++v)
    if (program_of(v) == program && (parts & ~kVariants[v].parts) == 0) return v;
  return static_cast<uint32_t>(program);
}

}  // namespace wavecomb
