// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/material/description/variants.h"

#include <algorithm>

#include "wavecomb/graph/parameters/ranges.h"
#include "wavecomb/medium/description/subsurface.h"

namespace wavecomb {

uint32_t parts_of(const Material& m, const GraphSet& graphs, std::span<const TexturePtr> textures,
                  bool allows_subsurface) {
  const DrivenRanges driven = driven_ranges(graphs, m.graph, textures);
  // Graphs override textures, and textures override constants.
  const auto may_pass = [&](const char* parameter, float limit, bool otherwise) {
    const auto& range = driven[graph_parameter(parameter)];
    return range ? range->low < limit || range->high > limit : otherwise;
  };
  const auto above_0 = [&](const char* parameter, bool otherwise) {
    return may_pass(parameter, 0, otherwise);
  };
  const auto effective = [&](Input input, float constant) {
    return constant != 0 || m.has_texture(input);
  };
  uint32_t parts = 0;
  const auto add = [&parts](Part part, bool is_shown) { parts |= is_shown ? part : 0u; };
  add(kTexturePart, m.graph != kNoGraph ||
                        std::any_of(m.textures.begin(), m.textures.end(),
                                    [](const TextureUse& u) { return u.texture != kNoTexture; }));
  add(kEmissionPart, m.emits());
  add(kMetalPart,
      m.specular_workflow || above_0("metallic", effective(Input::kMetallic, m.metallic)));
  add(kCoatPart, above_0("clearcoat", effective(Input::kClearcoat, m.clearcoat)));
  add(kTransmissionPart, m.transmits_straight() && may_pass("opacity", 1, true));
  if (has_trait(m.program, program_trait::kLayered)) {
    const OpenPbr& o = m.openpbr;
    add(kTransmissionPart, above_0("transmission_weight", o.transmission_weight != 0));
    const bool walks = allows_subsurface && subsurface_kind(m, graphs) != SubsurfaceKind::kNone;
    add(kBackDiffusePart,
        (o.thin_walled || walks) && above_0("subsurface_weight", o.subsurface_weight != 0));
    add(kFuzzPart, above_0("fuzz_weight", o.fuzz_weight != 0));
    add(kFilmPart, above_0("film_weight", o.film_weight != 0));
    add(kAnisotropyPart,
        above_0("anisotropy", o.anisotropy != 0) || above_0("rotation", o.rotation != 0));
  }
  return parts;
}

uint32_t cheapest_variant(ProgramId program, uint32_t parts) {
  for (uint32_t v = kProgramCount; v < kVariantCount; ++v)
    if (program_of(v) == program && (parts & ~kVariants[v].parts) == 0) return v;
  return static_cast<uint32_t>(program);
}

}  // namespace wavecomb
