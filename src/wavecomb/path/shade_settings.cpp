// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/path/shade_settings.h"

#include "wavecomb/core/settings.h"

namespace wavecomb {

ShadeSettings::ShadeSettings(const Settings& s)
    : sampler(s.sampler),
      max_depth(s.max_depth),
      roulette(s.roulette != RouletteKind::kOff && s.roulette != RouletteKind::kCostAware),
      cost_aware(s.roulette == RouletteKind::kCostAware),
      efficient(s.roulette == RouletteKind::kEfficient || s.roulette == RouletteKind::kAuto),
      roulette_depth(s.roulette_depth),
      clamp_indirect(s.clamp_indirect),
      schlick_fresnel(s.schlick_fresnel),
      cosine_sampling(s.cosine_sampling),
      filters_all_lookups(s.texture_filter == TextureFilter::kWhole),
      shows_environment(!s.alpha) {}

}  // namespace wavecomb
