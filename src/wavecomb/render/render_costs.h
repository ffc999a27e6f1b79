// SPDX-License-Identifier: Apache-2.0
/// Costs of materials over a render: where they start, and what each pass teaches.
#pragma once

#include <functional>
#include <string>
#include <utility>
#include <vector>

#include "wavecomb/integrate/wave.h"
#include "wavecomb/render/cost_profile.h"
#include "wavecomb/render/lane_kernels.h"

namespace wavecomb {

/// Contract: waves read `order` and `roulette` while a pass runs; between passes they are written.
class RenderCosts {
 public:
  RenderCosts(const Scene& scene, std::span<const MaterialTraits> traits, const Settings& settings);

  CostSnapshot order;     ///< for the order of shading
  CostSnapshot roulette;  ///< for cost-aware roulette
  bool measures() const { return measures_; }

  /// Before the first pass: takes over what a profile knows, and measures synthetic hits unless
  /// that is all or a model is asked for. Ends early where `halted` says so.
  void start(const WaveContext& context, const LaneKernels& kernels, const CostProfile* profile,
             const std::function<bool()>& halted);
  /// After a pass: what a worker measured. Empties the worker's tracker.
  void take(CostTracker& worker) { measured_.take(worker); }
  /// Then once for all workers.
  void merge();

  CostProfile profile() const;
  /// Before the first pass.
  const CostSnapshot& calibrated() const { return calibrated_; }
  double calibration_s() const { return calibration_s_; }
  /// Of the last pass that had any.
  const CostPrediction& prediction() const { return prediction_; }
  /// Sums over all passes, by material.
  const std::vector<double>& total_ns() const { return total_ns_; }
  const std::vector<uint64_t>& total_timed() const { return total_timed_; }

 private:
  /// Returns whether the profile knows all materials and textures.
  bool apply(const CostProfile& profile);

  const Scene& scene_;
  std::span<const MaterialTraits> traits_;
  const Settings& settings_;
  bool measures_;
  CostTracker measured_;  ///< of the pass
  std::vector<double> total_ns_;
  std::vector<uint64_t> total_timed_;
  CostSnapshot calibrated_;
  CostPrediction prediction_;
  double calibration_s_ = 0;
};

}  // namespace wavecomb
