// SPDX-License-Identifier: Apache-2.0
/// Render settings that shading reads.
#pragma once

#include "wavecomb/core/settings_choices.h"

namespace wavecomb {

struct Settings;

/// Render settings that shading reads.
struct ShadeSettings {
  SamplerKind sampler;
  uint32_t max_depth;
  bool roulette;    ///< roulette by throughput, after a vertex
  bool cost_aware;  ///< roulette by throughput and cost, before a vertex
  bool efficient;   ///< roulette by learned expected contribution, after a vertex
  uint32_t roulette_depth;
  float clamp_indirect;  ///< largest luminance of indirect contributions; 0 disables clamping
  bool schlick_fresnel;
  bool cosine_sampling;
  bool filters_all_lookups;
  bool shows_environment;  ///< whether camera rays show domes and distant lights

  explicit ShadeSettings(const Settings& settings);

  /// Returns whether a path that leaves the scene after `depth` vertices receives the light of the
  /// environment.
  bool adds_environment(uint32_t depth) const { return shows_environment || depth > 0; }
};

}  // namespace wavecomb
