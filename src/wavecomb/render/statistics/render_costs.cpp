// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/render/statistics/render_costs.h"

#include <algorithm>
#include <chrono>
#include <unordered_map>

#include "wavecomb/core/clock.h"
#include "wavecomb/core/denormals.h"
#include "wavecomb/core/settings.h"
#include "wavecomb/scene/scene.h"

namespace wavecomb {
namespace {

/// Measures costs on synthetic hits: the fastest of three runs for each material.
CostSnapshot calibrate(const Scene& scene, const WaveContext& context, const LaneKernels& kernels,
                       const std::function<bool()>& halted) {
  constexpr uint32_t kRecords = 256;
  Wave wave(kRecords, context);
  CostSnapshot costs = model_costs(scene);
  CostTracker tracker(context.traits.size());
  for (CalibrationHits& hits : find_calibration_hits(scene)) {
    if (halted()) break;
    hits.count = kRecords;
    double ns = kernels.time_material(wave, context, hits);
    for (int repeat = 0; repeat < 2; ++repeat)
      ns = std::min(ns, kernels.time_material(wave, context, hits));
    const std::vector<uint32_t> materials(hits.count, hits.material);
    tracker.charge(materials, ns);
  }
  std::fill(costs.texture_ns.begin(), costs.texture_ns.end(), 0.f);
  merge_costs(tracker, context.traits, 1.f, costs);
  return costs;
}

}  // namespace

RenderCosts::RenderCosts(const Scene& scene, std::span<const MaterialTraits> traits,
                         const Settings& settings)
    : order(model_costs(scene)),
      roulette(order),
      scene_(scene),
      traits_(traits),
      settings_(settings),
      measures_(settings.costs != CostSource::kModel &&
                settings.integrator == IntegratorKind::kWavefront),
      measured_(traits.size()),
      total_ns_(traits.size()),
      total_timed_(traits.size()),
      calibrated_(order) {}

void RenderCosts::start(const WaveContext& context, const LaneKernels& kernels,
                        const CostProfile* profile, const std::function<bool()>& halted) {
  const bool is_complete = profile && apply(*profile);
  if (measures_ && !is_complete) {
    const DenormalsOff denormals_off;
    const auto begin = std::chrono::steady_clock::now();
    order = calibrate(scene_, context, kernels, halted);
    calibration_s_ = seconds_since(begin);
    if (profile) apply(*profile);
  }
  calibrated_ = order;
  // Roulette affects the image, so it uses reproducible modelled costs, unless the settings ask for
  // measured costs or the caller provides a profile.
  if (settings_.costs == CostSource::kMeasured || profile) roulette = order;
}

void RenderCosts::merge() {
  for (size_t m = 0; m < total_ns_.size(); ++m) {
    total_ns_[m] += measured_.ns()[m];
    total_timed_[m] += measured_.timed()[m];
  }
  if (!measures_) return;
  const CostPrediction p = merge_costs(measured_, traits_, settings_.cost_weight, order);
  if (p.materials > 0) prediction_ = p;
  if (settings_.costs == CostSource::kMeasured) roulette = order;
  measured_ = CostTracker(traits_.size());
}

CostProfile RenderCosts::profile() const {
  CostProfile profile;
  for (size_t m = 0; m < order.material_ns.size(); ++m)
    profile.materials.emplace_back(scene_.materials()[m].name, order.material_ns[m]);
  for (size_t t = 0; t < order.texture_ns.size(); ++t)
    profile.textures.emplace_back(scene_.textures()[t]->name(), order.texture_ns[t]);
  return profile;
}

bool RenderCosts::apply(const CostProfile& profile) {
  using Costs = std::unordered_map<std::string, float>;
  const Costs materials(profile.materials.begin(), profile.materials.end());
  const Costs textures(profile.textures.begin(), profile.textures.end());
  bool is_complete = true;
  for (size_t m = 0; m < order.material_ns.size(); ++m) {
    const auto at = materials.find(scene_.materials()[m].name);
    const bool known = at != materials.end() && at->second > 0;
    if (known) order.material_ns[m] = at->second;
    is_complete = is_complete && known;
  }
  for (size_t t = 0; t < order.texture_ns.size(); ++t) {
    const auto at = textures.find(scene_.textures()[t]->name());
    // a cost of 0 means that the texture's cost is too small to be measured
    const bool known = at != textures.end() && at->second >= 0;
    if (known) order.texture_ns[t] = at->second;
    is_complete = is_complete && known;
  }
  double sum = 0;
  for (float ns : order.material_ns) sum += ns;
  order.mean_ns = static_cast<float>(sum / static_cast<double>(order.material_ns.size()));
  return is_complete;
}

}  // namespace wavecomb
