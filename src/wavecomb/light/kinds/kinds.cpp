// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/light/kinds/kinds.h"

#include "wavecomb/light/records/record_builder.h"

namespace wavecomb {

std::span<const LightKindInfo> light_kinds() {
  const auto described = []<typename Kind>(Kind) {
    LightKindInfo kind = Kind::describe();
    if constexpr (Kind::kIsInfinite) kind.traits |= light_trait::kInfinite;
    return kind;
  };
#define WAVECOMB_LIGHT_KIND(name) described(name##Kind{}),
  static const std::vector<LightKindInfo> kinds = {WAVECOMB_LIGHT_KINDS(WAVECOMB_LIGHT_KIND)};
#undef WAVECOMB_LIGHT_KIND
  return kinds;
}

namespace {

/// Returns whether a light filter, or a filter chained to it, depends on the distance that the
/// light travels. This distance is unknown when a light path starts.
bool fades(std::span<const LightFilter> filters, uint32_t filter) {
  for (; filter != kNoFilter; filter = filters[filter].next)
    if (filters[filter].fades()) return true;
  return false;
}

ShapeVisibility shape_visibility(const Light& light, const LightKindInfo& kind) {
  if (kind.has(light_trait::kInfinite)) return ShapeVisibility::kAllRays;
  if (!light.visible) return ShapeVisibility::kNoRays;
  if (!light.visible_to_camera && kind.has(light_trait::kOwnShape))
    return ShapeVisibility::kDeltaBounces;
  return ShapeVisibility::kAllRays;
}

}  // namespace

LightBuild make_light(const Light& light, LightBuildContext& context) {
  const LightKindInfo& kind = info_of(light.kind);
  LightBuild out;
  LightRecord& r = out.record;
  r.kind = static_cast<uint32_t>(light.kind);
  r.texture = kind.has(light_trait::kTextured) ? light.texture : kNoTexture;
  r.shaping = kNoShaping;
  r.portals = kNoPortals;
  r.distribution = kNoDistribution;
  r.diffuse = std::max(0.f, light.diffuse);
  r.specular = std::max(0.f, light.specular);
  const ShapeVisibility visibility = shape_visibility(light, kind);
  r.visibility = static_cast<uint32_t>(visibility);
  r.light_link = light.light_link;
  r.shadow_link = light.shadow_link;
  r.shadow = kPlainShadow;
  if (!light.shadow.is_plain()) {
    r.shadow = static_cast<uint32_t>(context.set.shadows.size());
    context.set.shadows.push_back(record_builder::make_shadow(light.shadow));
  }
  r.filter = kind.has(light_trait::kFiltered) ? light.filter : kNoFilter;
  r.sampled_only = visibility != ShapeVisibility::kAllRays || r.shadow_link != kNoSet ||
                   r.shadow != kPlainShadow;
  r.camera_only = r.sampled_only != 0 || r.diffuse != 1 || r.specular != 1 ||
                  r.light_link != kNoSet || light.moves() || fades(context.filters, r.filter);
  if (kind.make) kind.make(out, light, context);
  if (!light.shaping.is_plain() && kind.has(light_trait::kShaped))
    record_builder::add_shaping(out, light, context);
  return out;
}

}  // namespace wavecomb
