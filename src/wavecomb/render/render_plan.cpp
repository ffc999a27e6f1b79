// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/render/render_plan.h"

#include <tbb/info.h>

#include <algorithm>
#include <string>

#include "wavecomb/light/tree/light_tree.h"
#include "wavecomb/material/energy_tables.h"

namespace wavecomb {
namespace {

/// Default number of paths in a wave (docs/decisions/wave-size.md), and samples per pixel that a
/// pass adds.
constexpr uint32_t kDefaultWaveSize = 4096;
constexpr uint32_t kPassSamples = 16;

/// Brightness of the darkest layer of cascades (film/cascades.h), relative to the brightness of the
/// scene.
constexpr float kDarkestShare = 0x1p-12f;

/// Creates the policy called `name`. For "adaptive", creates all policies among which the chooser
/// selects, starting with "none".
std::vector<std::unique_ptr<SchedulingPolicy>> make_policies(const std::string& name) {
  std::vector<std::unique_ptr<SchedulingPolicy>> policies;
  if (name == "adaptive")
    for (const char* one : {"none", "code", "material", "texture", "texture-locality"})
      policies.push_back(make_policy(one));
  else
    policies.push_back(make_policy(name));
  return policies;
}

WaveSetup wave_setup(const Settings& settings) {
  return {choose_lanes(settings.lanes), thread_count(settings),
          wave_size_for(settings, settings.rendered().pixels())};
}

SceneView view_for(const Scene& scene, const Settings& settings, uint32_t threads) {
  SceneView view = scene.view();
  view.lights.by_tree = chooses_by_tree(settings.light_selection, view.lights);
  if (view.lights.by_tree) view.lights.tree = scene.light_tree(threads).view();
  view.materials.energy = energy_tables(scene.materials());
  return view;
}

}  // namespace

uint32_t thread_count(const Settings& settings) {
  return settings.threads != 0 ? settings.threads
                               : static_cast<uint32_t>(tbb::info::default_concurrency());
}

uint32_t wave_size_for(const Settings& settings, uint64_t pixels) {
  const uint64_t total = settings.spp * pixels;
  const uint64_t share = std::max<uint64_t>(64, total / (uint64_t{thread_count(settings)} * 4));
  return static_cast<uint32_t>(
      std::min<uint64_t>(settings.wave_size != 0 ? settings.wave_size : kDefaultWaveSize, share));
}

OrderGrid order_grid(const Bounds& bounds) {
  OrderGrid grid;
  if (bounds.empty()) return grid;
  const float lo[3] = {bounds.lo.x, bounds.lo.y, bounds.lo.z};
  const float hi[3] = {bounds.hi.x, bounds.hi.y, bounds.hi.z};
  for (int i = 0; i < 3; ++i) {
    grid.lo[i] = lo[i];
    grid.scale[i] = hi[i] > lo[i] ? 1024.f / (hi[i] - lo[i]) : 0.f;
  }
  return grid;
}

uint32_t samples_of_pass(const Settings& settings, uint64_t pixels, uint32_t wave_size) {
  const auto fill = static_cast<uint32_t>((wave_size + pixels - 1) / pixels);
  return JointPlan::pass_samples(settings,
                                 std::min({settings.spp, wave_size, std::max(kPassSamples, fill)}));
}

RenderPlan::RenderPlan(const Scene& scene, const EmbreeAccelerator& accelerator,
                       const Settings& settings, JointShare joint_share,
                       const SchedulingPolicy* policy)
    : scene(scene),
      accelerator(accelerator),
      settings(settings),
      waves(wave_setup(settings)),
      kernels(lane_kernels(waves.lanes)),
      pass_samples(samples_of_pass(settings, settings.rendered().pixels(), waves.wave_size)),
      traits(material_traits(scene)),
      filter(settings.filter, settings.used_filter_width()),
      camera(scene.camera(), settings.width, settings.height, filter, settings.overscan),
      aovs(scene, settings),
      window(settings.film()),
      joint(scene, settings, joint_share, camera, filter),
      view(view_for(scene, settings, waves.threads)) {
  if (policy) {
    policies.push_back(policy);
  } else {
    owned_policies_ = make_policies(settings.policy);
    for (const auto& owned : owned_policies_) policies.push_back(owned.get());
  }
}

Film RenderPlan::make_film() const {
  Film film(window, aovs.layout, settings.needs_error());
  joint.allocate(film);
  if (settings.firefly == Firefly::kReweight)
    film.allocate_cascades(scene_brightness(scene) * kDarkestShare);
  return film;
}

WaveContext RenderPlan::make_context(Film& film, RenderCosts& costs, RayRecorder* recorder,
                                     const JointPasses& passes) const {
  const bool wants_position = std::any_of(policies.begin(), policies.end(), [](const auto* one) {
    return (one->columns() & kPositionColumn) != 0;
  });
  const bool is_single = settings.traversal == Traversal::kSingle;
  return {
      .scene = view,
      .accel = &accelerator,
      .settings = &settings,
      .camera = &camera,
      .policies = policies,
      .traits = traits,
      .costs = &costs.order,
      .roulette_costs = &costs.roulette,
      .grid = order_grid(scene.bounds()),
      .film = &film,
      .traversal_width = is_single ? 1u : std::min(waves.lanes, accelerator.native_width()),
      .wants_position = wants_position,
      .measures_costs = costs.measures(),
      .recorder = recorder,
      .aovs = &aovs,
      .joint = joint.context(passes.grid()),
  };
}

}  // namespace wavecomb
