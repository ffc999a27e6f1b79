// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/aov/aov_tables.h"

#include <algorithm>

#include "wavecomb/core/error.h"
#include "wavecomb/film/layer_ids.h"
#include "wavecomb/light/kinds/kinds.h"
#include "wavecomb/light/sampling/light_sample.h"
#include "wavecomb/scene/scene.h"

namespace wavecomb {

AovTables::AovTables(const Scene& scene, const Settings& settings) {
  layout.set = settings.aovs;
  connects = settings.connects();
  layout.deep = {settings.deep_samples, settings.deep_tolerance};
  if (settings.allocate == Allocate::kEfficiency) {
    layout.set.bits = layout.set.bits | Aov::kCost;
    models_cost = settings.costs != CostSource::kMeasured;
  }
  if (layout.set.has(Aov::kDeep) && scene.view().volumes.emits)
    throw Error(
        "deep pictures know no volumes that glow: light without a surface has no depth there; give "
        "no deep picture, or no emission");
  if (layout.set.has(Aov::kMotion) && scene.camera().projection == Projection::kLatlong)
    throw Error("the AOV motion is none of latlong cameras; give others, or another projection");
  check_id_layers(layout.set, scene.instances().size() + 1, scene.materials().size());
  // Ids of instances and materials do not need these tables, but ids of objects do.
  if (layout.set.has(AovKind::kCoverage)) crypto = CryptoTables(scene, layout.set);
  if (layout.set.has(Aov::kLightGroups)) keep_groups(scene, settings);
  if (layout.set.has(Aov::kExpressions)) keep_expressions(scene, settings);
}

void AovTables::keep_groups(const Scene& scene, const Settings& settings) {
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
  group_of_rest = place.front();
  layout.light_groups = static_cast<uint32_t>(kept_names.size());
}

void AovTables::keep_expressions(const Scene& scene, const Settings& settings) {
  automaton = PathAutomaton(settings.expressions, scene.light_groups());
  if (settings.joins_light()) backward = BackwardAutomaton(automaton);
  layout.expressions = automaton.expressions;
  for (const NamedExpression& one : settings.expressions) kept_names.push_back(one.name);
  const std::vector<uint32_t> groups = scene.groups_of_lights();
  const std::vector<uint8_t> objects = scene.lights_of_objects();
  const LightSet& set = scene.light_set();
  for (size_t i = 0; i < groups.size(); ++i) {
    const bool is_background =
        i < set.first_triangle() &&
        info_of(static_cast<LightKind>(set.records[i].kind)).has(light_trait::kBackground);
    const PathEnd end = is_background ? PathEnd::kBackground
                        : objects[i]  ? PathEnd::kObject
                                      : PathEnd::kLight;
    end_of_light.push_back(path_end(end, groups[i]));
  }
  if (const LightView lights = scene.view().lights; lights.has_effects)
    for (uint32_t i = 0; i < groups.size(); ++i) {
      const LightEffect<float> effect(lights, i, true);
      multipliers.push_back(effect.diffuse);
      multipliers.push_back(effect.specular);
    }
  end_of_light.push_back(path_end(PathEnd::kObject, 0));
  end_of_light.push_back(path_end(PathEnd::kVolume, 0));
}

}  // namespace wavecomb
