// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/light/kinds/kinds.h"

#include "wavecomb/light/kinds/record_builder.h"

namespace wavecomb {

std::span<const LightKindInfo> light_kinds() {
#define WAVECOMB_LIGHT_KIND(name) name##Kind::describe(),
  static const std::vector<LightKindInfo> kinds = {WAVECOMB_LIGHT_KINDS(WAVECOMB_LIGHT_KIND)};
#undef WAVECOMB_LIGHT_KIND
  return kinds;
}

namespace {

/// Returns whether a filter, or one chained to it, depends on the distance that light travels,
/// which light paths do not know.
bool fades(std::span<const LightFilter> filters, uint32_t filter) {
  for (; filter != kNoFilter; filter = filters[filter].next)
    if (filters[filter].fades()) return true;
  return false;
}

}  // namespace

MadeLight make_light(const Light& light, LightMaking& making) {
  const LightKindInfo& kind = info_of(light.kind);
  MadeLight made;
  LightRecord& r = made.record;
  r.kind = static_cast<uint32_t>(light.kind);
  r.texture = kind.has(light_trait::kPictured) ? light.texture : kNoTexture;
  r.shaping = kNoShaping;
  r.portals = kNoPortals;
  r.distribution = kNoDistribution;
  r.diffuse = std::max(0.f, light.diffuse);
  r.specular = std::max(0.f, light.specular);
  r.hidden = !light.visible && !kind.has(light_trait::kInfinite);
  r.light_link = light.light_link;
  r.shadow_link = light.shadow_link;
  r.shadow = kPlainShadow;
  if (!light.shadow.is_plain()) {
    r.shadow = static_cast<uint32_t>(making.set.shadows.size());
    making.set.shadows.push_back(making::make_shadow(light.shadow));
  }
  r.filter = kind.has(light_trait::kFiltered) ? light.filter : kNoFilter;
  r.sampled_only = r.hidden != 0 || r.shadow_link != kNoSet || r.shadow != kPlainShadow;
  r.camera_only = r.sampled_only != 0 || r.diffuse != 1 || r.specular != 1 ||
                  r.light_link != kNoSet || light.moves() || fades(making.filters, r.filter);
  if (kind.make) kind.make(made, light, making);
  if (!light.shaping.is_plain() && kind.has(light_trait::kShaped))
    making::add_shaping(made, light, making);
  return made;
}

}  // namespace wavecomb
