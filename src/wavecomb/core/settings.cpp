// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/core/settings.h"

#include "wavecomb/core/error.h"
#include "wavecomb/core/settings_table.h"

namespace wavecomb {

LightPathConflict light_path_conflict(const Settings& s) {
  if (s.clamp_indirect > 0) return {"clamp_indirect", "clamp_indirect 0"};
  if (s.cosine_sampling) return {"cosine_sampling", "none"};
  if (s.aovs.has(Aov::kDeep)) return {"the AOV deep, which lacks light path contributions", "none"};
  if (s.merge_radius <= 0) return {};
  if (s.connects()) return {"merge_radius", "merge_radius 0"};
  if (s.needs_error()) return {"merge_radius and errors of pixels", "merge_radius 0"};
  for (const Aov aov : {Aov::kDirect, Aov::kIndirect, Aov::kLightGroups, Aov::kExpressions})
    if (s.aovs.has(aov)) return {"merge_radius and AOVs that split the beauty", "merge_radius 0"};
  return {};
}

Error light_path_error(const Settings& s, const LightPathConflict& conflict) {
  return Error("transport " + std::string(s.connects() ? "bdpt" : "light") + " does not go with " +
               conflict.what + "; give " + conflict.instead + ", or transport path or auto");
}

void Settings::check() const {
  for (const SettingInfo& setting : setting_table()) setting.check(*this);
  if (aovs.has(Aov::kDeep) && firefly != Firefly::kKeep)
    throw Error(
        "firefly reweight does not go with deep images, whose samples would not add up to the "
        "beauty; give firefly keep");
  if (joins_light())
    if (const LightPathConflict conflict = light_path_conflict(*this); !conflict.what.empty())
      throw light_path_error(*this, conflict);
  check_expressions(expressions);
  if (uint64_t{width} * height > kMaxPixels)
    throw Error("width x height is " + std::to_string(uint64_t{width} * height) +
                "; it must be from 1 to " + std::to_string(kMaxPixels));
  if (width <= 2 * uint64_t{overscan} || height <= 2 * uint64_t{overscan})
    throw Error("overscan is " + std::to_string(overscan) +
                ", which covers the whole image; width and height include the overscan");
  if (region) {
    const auto text = [](uint32_t v) { return std::to_string(v); };
    const Region& r = *region;
    const std::string given =
        "region " + text(r.x0) + " " + text(r.y0) + " " + text(r.x1) + " " + text(r.y1);
    if (r.x0 >= r.x1 || r.y0 >= r.y1)
      throw Error(given + " has no pixels; give X0 Y0 X1 Y1 with X0 < X1 and Y0 < Y1");
    if (r.x1 > width || r.y1 > height)
      throw Error(given + " is not within the picture; X1 is at most " + text(width) +
                  " and Y1 at most " + text(height));
  }
  if (adaptive > 0 && noise > 0)
    throw Error("adaptive and noise are both set; set only one of them");
  if (allocates_samples() && is_adaptive())
    throw Error(
        "allocate is for renders with a given number of samples or seconds; adaptive and noise "
        "distribute samples themselves: set only one of them");
  if (allocates_samples() && region)
    throw Error(
        "allocate error and efficiency depend on the whole image, so a region would differ from "
        "the same part of a full render; give allocate even, or no region");
  if (is_adaptive() && min_spp > spp)
    throw Error("min_spp is " + std::to_string(min_spp) + "; it must not be above spp, which is " +
                std::to_string(spp));
}

}  // namespace wavecomb
