// SPDX-License-Identifier: Apache-2.0
/// Costs of materials during a render: initial values, and updates after each pass.
#pragma once

#include <functional>
#include <string>
#include <utility>
#include <vector>

#include "wavecomb/render/lane_kernels.h"
#include "wavecomb/render/statistics/cost_profile.h"
#include "wavecomb/wave/wave.h"

namespace wavecomb {

/// Measured and predicted shading costs of a render.
///
/// Contract: waves read `order` and `roulette` during a pass; both change only between passes.
class RenderCosts {
 public:
  RenderCosts(const Scene& scene, std::span<const MaterialTraits> traits, const Settings& settings);

  CostSnapshot order;     ///< costs for the order of shading
  CostSnapshot roulette;  ///< costs for cost-aware roulette
  bool measures() const { return measures_; }

  /// Sets the costs before the first pass: from a profile, and by measuring synthetic hits if the
  /// profile does not cover all materials and the settings ask for measured costs. Ends early if
  /// `halted` returns true.
  void start(const WaveContext& context, const LaneKernels& kernels, const CostProfile* profile,
             const std::function<bool()>& halted);
  /// Adds the measurements of a worker after a pass and resets its tracker.
  void take(CostTracker& worker) { measured_.take(worker); }
  /// Updates the costs, after take() for all workers.
  void merge();

  CostProfile profile() const;
  /// Costs before the first pass.
  const CostSnapshot& calibrated() const { return calibrated_; }
  double calibration_s() const { return calibration_s_; }
  /// Accuracy of cost predictions, in the last pass that had predictions.
  const CostPrediction& prediction() const { return prediction_; }
  /// Total time and number of timed records of each material, over all passes.
  const std::vector<double>& total_ns() const { return total_ns_; }
  const std::vector<uint64_t>& total_timed() const { return total_timed_; }

 private:
  /// Applies a profile. Returns whether the profile covers all materials and textures.
  bool apply(const CostProfile& profile);

  const Scene& scene_;
  std::span<const MaterialTraits> traits_;
  const Settings& settings_;
  bool measures_;
  CostTracker measured_;  ///< measurements of the pass
  std::vector<double> total_ns_;
  std::vector<uint64_t> total_timed_;
  CostSnapshot calibrated_;
  CostPrediction prediction_;
  double calibration_s_ = 0;
};

}  // namespace wavecomb
