// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/light_paths/light_path_aovs.h"

#include <array>

namespace wavecomb {
namespace {

/// Parts of a light splat, by light path expression.
struct SplatParts {
  uint32_t found = 0;  ///< bit mask of the expressions with a part
  std::array<Color<float>, PathAutomaton::kMostExpressions> light{};

  void add(uint32_t matched, uint32_t colour, float value) {
    if (value == 0) return;
    found |= matched;
    for (; matched != 0; matched &= matched - 1) {
      Color<float>& to = light[static_cast<size_t>(std::countr_zero(matched))];
      (colour == 0 ? to.x : colour == 1 ? to.y : to.z) += value;
    }
  }
};

/// Splits a light splat by expression. The light path, in the states of `row`, ends at the camera
/// without further scattering.
SplatParts split_splat(const BackwardAutomaton& automaton, const LightWayRow<float>& row,
                       const Color<float>& c) {
  SplatParts parts;
  const auto add = [&](uint32_t lobe, const Color<float>& part) {
    for_each_colour<float>(part, [&](uint32_t colour, float value) {
      const uint32_t state = ColourStates::next<float>(
          automaton.next.data(), ColourStates::of<float>(row.shown_states, colour), row.shown_event,
          lobe, true);
      parts.add(automaton.matched[size_t{state} * automaton.forward_states], colour, value);
    });
  };
  const Color<float> diffuse = c * row.shown_diffuse;
  add(kDiffuseEvent, diffuse);
  add(kGlossyEvent, c - diffuse);
  return parts;
}

}  // namespace

void LightPathAovs::show(Film& film, const SplatFilter& filter, const LightSplat& splat) const {
  SplatParts parts;
  if (backward_)
    parts = split_splat(*backward_, load_row<LightWayRow, float>(ways_.rows, splat.slot, true),
                        splat.c);
  const uint32_t scattered = splat.depth == 0 ? places_.direct : places_.indirect;
  uint32_t group = SplatPlaces::kNowhere;
  if (places_.first_group != SplatPlaces::kNowhere && tables_->kept_group[splat.light] != kNoGroup)
    group = places_.first_group + tables_->kept_group[splat.light];
  filter.spread(film, splat.x, splat.y, [&](size_t pixel, float weight) {
    const auto add = [&](uint32_t place, const Color<float>& v) {
      film.aovs().add_splat(pixel, place, v.x * weight, v.y * weight, v.z * weight);
    };
    if (scattered != SplatPlaces::kNowhere) add(scattered, splat.c);
    if (group != SplatPlaces::kNowhere) add(group, splat.c);
    for (uint32_t left = parts.found; left != 0; left &= left - 1) {
      const auto e = static_cast<uint32_t>(std::countr_zero(left));
      add(places_.first_expression + e, parts.light[e]);
    }
  });
}

}  // namespace wavecomb
