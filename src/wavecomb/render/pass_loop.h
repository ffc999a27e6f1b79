// SPDX-License-Identifier: Apache-2.0
/// Pass after pass, until the picture is what the settings ask for.
#pragma once

#include <atomic>
#include <cstdint>
#include <limits>
#include <span>
#include <vector>

#include "wavecomb/core/clock.h"
#include "wavecomb/film/film.h"
#include "wavecomb/render/allotment.h"
#include "wavecomb/render/light_paths.h"
#include "wavecomb/render/pass_plan.h"
#include "wavecomb/render/pass_runner.h"
#include "wavecomb/render/render_costs.h"
#include "wavecomb/render/render_status.h"
#include "wavecomb/render/watch.h"

namespace wavecomb {

/// Contract: run() on one thread, within the runner's arena; status() on any. What is rendered
/// depends on film, settings and pass alone, but where there is a time limit.
class PassLoop {
 public:
  /// `pass`: of the film, where it comes from a checkpoint. `step`: samples a pixel that a pass of
  /// a render that is not adaptive adds. `light_share`: of paths from lights, where there are any.
  /// `before_lights`: called before the paths of a pass that start at lights, after the others; or
  /// null.
  PassLoop(const Settings& settings, uint32_t step, PassState pass, LightPathShare light_share,
           Film& film, PassRunner& runner, RenderCosts& costs, Watch& watch,
           std::function<void()> before_lights = nullptr);

  void run();
  RenderStatus status() const;
  /// While the work stands still.
  const PassState& pass() const { return pass_; }
  const AllotmentFacts& allotment() const { return allotment_; }

 private:
  /// Paths from lights that the pass is to have still; none where there are no such paths.
  PassPlan light_plan() const;
  /// Decides on the next pass. False: the picture is done.
  bool begin_pass(std::span<const uint32_t> samples);
  bool is_late() const;
  double seconds() const;

  const Settings& settings_;
  PassRules rules_;
  PassState pass_;
  LightPathShare light_share_;
  Film& film_;
  PassRunner& runner_;
  RenderCosts& costs_;
  Watch& watch_;
  std::function<void()> before_lights_;
  std::vector<uint32_t> order_;
  std::vector<uint32_t> light_order_;  ///< of the numbers of paths from lights
  AllotmentFacts allotment_;
  Clock::time_point start_ = Clock::now();
  uint64_t resumed_samples_ = 0;
  double samples_per_s_ = 0;  ///< of the last pass
  std::atomic<bool> may_be_cut_{false};
  std::atomic<uint32_t> passes_{0};
  std::atomic<uint64_t> expected_samples_{0}, active_pixels_{0};
  std::atomic<double> error_{std::numeric_limits<double>::infinity()};
};

}  // namespace wavecomb
