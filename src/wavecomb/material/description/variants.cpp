// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/material/description/variants.h"

#include <algorithm>

#include "wavecomb/graph/parameters/ranges.h"
#include "wavecomb/medium/description/subsurface.h"

namespace wavecomb {

uint32_t parts_of(const Material& m, const GraphSet& graphs, std::span<const TexturePtr> textures,
                  bool may_walk) {
  const DrivenRanges driven = driven_ranges(graphs, m.graph, textures);
  // Graphs override textures, and textures override constants.
  const auto may_pass = [&](const char* parameter, float limit, bool otherwise) {
    const auto& range = driven[graph_parameter(parameter)];
    return range ? range->low < limit || range->high > limit : otherwise;
  };
  const auto above_0 = [&](const char* parameter, bool otherwise) {
    return may_pass(parameter, 0, otherwise);
  };
  const auto shown = [&](Input input, float constant) {
    return constant != 0 || m.has_texture(input);
  };
  uint32_t parts = 0;
  const auto add = [&parts](Part part, bool is_shown) { parts |= is_shown ? part : 0u; };
  add(kVaries, m.graph != kNoGraph ||
                   std::any_of(m.textures.begin(), m.textures.end(),
                               [](const TextureUse& u) { return u.texture != kNoTexture; }));
  add(kGlows, m.emits());
  add(kMetals, m.specular_workflow || above_0("metallic", shown(Input::kMetallic, m.metallic)));
  add(kCoats, above_0("clearcoat", shown(Input::kClearcoat, m.clearcoat)));
  if (has_trait(m.program, program_trait::kTransmitsByOpacity)) {
    // Opacity as presence is handled by ray traversal, not by the BSDF.
    const bool is_presence = m.opacity_threshold > 0 || (m.presence && m.needs_presence());
    add(kPasses, !is_presence && may_pass("opacity", 1, m.opacity != 1 || m.opacity_varies()));
  }
  if (has_trait(m.program, program_trait::kLayered)) {
    const OpenPbr& o = m.openpbr;
    add(kPasses, above_0("transmission_weight", o.transmission_weight != 0));
    const bool walks = may_walk && walk_kind(m, graphs) != WalkKind::kNone;
    add(kBacks, (o.thin_walled || walks) && above_0("subsurface_weight", o.subsurface_weight != 0));
    add(kFuzzes, above_0("fuzz_weight", o.fuzz_weight != 0));
    add(kFilms, above_0("film_weight", o.film_weight != 0));
    add(kBrushes, above_0("anisotropy", o.anisotropy != 0) || above_0("rotation", o.rotation != 0));
  }
  return parts;
}

uint32_t least_variant(ProgramId program, uint32_t parts) {
  for (uint32_t v = kProgramCount; v < kVariantCount; ++v)
    if (program_of(v) == program && (parts & ~kVariants[v].parts) == 0) return v;
  return static_cast<uint32_t>(program);
}

}  // namespace wavecomb
