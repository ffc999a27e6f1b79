// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/light_paths/light_path_aovs.h"

#include <array>

namespace wavecomb {
namespace {

/// Parts of a light splat. Each light path expression that matches the path has one part.
struct LightSplatParts {
  uint32_t found = 0;  ///< bit k is set if light path expression k has a part
  std::array<Color<float>, PathAutomaton::kMaxExpressions> light{};

  void add(uint32_t matched, uint32_t colour, float value) {
    if (value == 0) return;
    found |= matched;
    for (; matched != 0; matched &= matched - 1) {
      Color<float>& to = light[static_cast<size_t>(std::countr_zero(matched))];
      (colour == 0 ? to.x : colour == 1 ? to.y : to.z) += value;
    }
  }
};

/// Splits a light splat into parts for the light path expressions. The light path has the automaton
/// states of `row` and ends at the camera without further scattering.
LightSplatParts split_light_splat(const BackwardAutomaton& automaton,
                                  const LightPathStateRow<float>& row, const Color<float>& c) {
  LightSplatParts parts;
  const auto add = [&](uint32_t lobe, const Color<float>& part) {
    for_each_colour<float>(part, [&](uint32_t colour, float value) {
      const uint32_t state = ColourStates::next<float>(
          automaton.next.data(), ColourStates::of<float>(row.splat_states, colour), row.splat_event,
          lobe, true);
      parts.add(automaton.matched[size_t{state} * automaton.forward_states], colour, value);
    });
  };
  const Color<float> diffuse = c * row.splat_diffuse;
  add(kDiffuseEvent, diffuse);
  add(kGlossyEvent, c - diffuse);
  return parts;
}

}  // namespace

void LightPathAovs::add_to_film(Film& film, const LightSplatFilter& filter,
                                const LightSplat& splat) const {
  LightSplatParts parts;
  if (backward_)
    parts = split_light_splat(
        *backward_, load_row<LightPathStateRow, float>(states_.rows, splat.slot, true), splat.c);
  const uint32_t scattered = splat.depth == 0 ? layout_.direct : layout_.indirect;
  uint32_t group = LightSplatLayout::kNotStored;
  if (layout_.first_group != LightSplatLayout::kNotStored &&
      tables_->film_group[splat.light] != kNoGroup)
    group = layout_.first_group + tables_->film_group[splat.light];
  filter.spread(film, splat.at, [&](size_t pixel, float weight) {
    const auto add = [&](uint32_t sum_index, const Color<float>& v) {
      film.aovs().add_light_splat(pixel, sum_index, v.x * weight, v.y * weight, v.z * weight);
    };
    if (scattered != LightSplatLayout::kNotStored) add(scattered, splat.c);
    if (group != LightSplatLayout::kNotStored) add(group, splat.c);
    for (uint32_t left = parts.found; left != 0; left &= left - 1) {
      const auto e = static_cast<uint32_t>(std::countr_zero(left));
      add(layout_.first_expression + e, parts.light[e]);
    }
  });
}

}  // namespace wavecomb
