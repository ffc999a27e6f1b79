// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/aov/aov_tables.h"

#include <algorithm>

#include "wavecomb/core/error.h"
#include "wavecomb/core/settings.h"
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
        "deep images do not support volumes with emission, whose light has no depth; render "
        "without "
        "a deep image, or without the emission");
  if (layout.set.has(Aov::kMotion) && scene.camera().projection == Projection::kLatlong)
    throw Error(
        "the AOV motion does not support latlong cameras; leave it out, or use another projection");
  check_id_layers(layout.set, scene.instances().size() + 1, scene.materials().size());
  // The AOVs of object ids need the Cryptomatte tables. The AOVs of instance and material ids do
  // not need them.
  if (layout.set.has(AovKind::kCoverage)) crypto = CryptoTables(scene, layout.set);
  if (layout.set.has(Aov::kLightGroups)) add_groups(scene, settings);
  if (layout.set.has(Aov::kExpressions)) add_expressions(scene, settings);
}

void AovTables::add_groups(const Scene& scene, const Settings& settings) {
  const std::vector<std::string>& scene_groups = scene.light_groups();
  if (settings.light_groups.empty()) {
    layer_names = scene_groups;
  } else {
    for (const std::string& name : settings.light_groups) {
      if (std::find(scene_groups.begin(), scene_groups.end(), name) == scene_groups.end()) {
        std::string list;
        for (const std::string& known : scene_groups) list += (list.empty() ? "" : ", ") + known;
        throw Error("the scene has no light group '" + name + "'; it has " + list);
      }
      if (std::find(layer_names.begin(), layer_names.end(), name) == layer_names.end())
        layer_names.push_back(name);
    }
  }
  std::vector<uint32_t> group_index(scene_groups.size(), kNoGroup);
  for (size_t g = 0; g < scene_groups.size(); ++g) {
    const auto at = std::find(layer_names.begin(), layer_names.end(), scene_groups[g]);
    if (at != layer_names.end()) group_index[g] = static_cast<uint32_t>(at - layer_names.begin());
  }
  film_group = scene.groups_of_lights();
  for (uint32_t& group : film_group) group = group_index[group];
  group_of_rest = group_index.front();
  layout.light_groups = static_cast<uint32_t>(layer_names.size());
}

void AovTables::add_expressions(const Scene& scene, const Settings& settings) {
  automaton = PathAutomaton(settings.expressions, scene.light_groups());
  if (settings.joins_light()) backward = BackwardAutomaton(automaton);
  layout.expressions = automaton.expressions;
  for (const NamedExpression& one : settings.expressions) layer_names.push_back(one.name);
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
