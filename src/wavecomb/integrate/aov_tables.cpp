// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/integrate/aov_tables.h"

#include <algorithm>

#include "wavecomb/core/error.h"
#include "wavecomb/film/layer_ids.h"
#include "wavecomb/integrate/path_pool.h"
#include "wavecomb/scene/scene.h"

namespace wavecomb {

AovTables::AovTables(const Scene& scene, const Settings& settings) {
  layout.set = settings.aovs;
  if (settings.allocate == Allocate::kEfficiency) {
    layout.set.bits = layout.set.bits | Aov::kCost;
    models_cost = settings.costs != CostSource::kMeasured;
  }
  check_id_layers(layout.set, scene.instances().size() + 1, scene.materials().size());
  // Ids of instances and materials need none of it; positions of objects do.
  if (layout.set.has(AovKind::kCoverage)) crypto = CryptoTables(scene, layout.set);
  if (!layout.set.has(Aov::kLightGroups)) return;
  const std::vector<std::string>& there = scene.light_groups();
  if (settings.light_groups.empty()) {
    kept_names = there;
  } else {
    for (const std::string& name : settings.light_groups) {
      if (std::find(there.begin(), there.end(), name) == there.end()) {
        std::string list;
        for (const std::string& known : there) list += (list.empty() ? "" : ", ") + known;
        throw Error("the scene has no light group '" + name + "'; it has " + list);
      }
      if (std::find(kept_names.begin(), kept_names.end(), name) == kept_names.end())
        kept_names.push_back(name);
    }
  }
  std::vector<uint32_t> place(there.size(), kNoGroup);
  for (size_t g = 0; g < there.size(); ++g) {
    const auto at = std::find(kept_names.begin(), kept_names.end(), there[g]);
    if (at != kept_names.end()) place[g] = static_cast<uint32_t>(at - kept_names.begin());
  }
  kept_group = scene.groups_of_lights();
  for (uint32_t& group : kept_group) group = place[group];
  layout.light_groups = static_cast<uint32_t>(kept_names.size());
}

}  // namespace wavecomb
