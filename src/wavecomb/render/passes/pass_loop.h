// SPDX-License-Identifier: Apache-2.0
/// Loop over the passes of a render.
#pragma once

#include <atomic>
#include <cstdint>
#include <limits>
#include <span>
#include <vector>

#include "wavecomb/core/clock.h"
#include "wavecomb/film/film.h"
#include "wavecomb/light_paths/setup.h"
#include "wavecomb/render/passes/allotment.h"
#include "wavecomb/render/passes/pass_plan.h"
#include "wavecomb/render/passes/pass_runner.h"
#include "wavecomb/render/render_plan.h"
#include "wavecomb/render/render_status.h"
#include "wavecomb/render/statistics/render_costs.h"
#include "wavecomb/render/watch.h"

namespace wavecomb {

/// Renders passes until the settings' goal is reached: samples, error or time.
///
/// Contract: run() on one thread, within the runner's arena; status() on any thread. The rendered
/// samples depend on film, settings and pass only, unless there is a time limit.
class PassLoop {
 public:
  /// `pass` is the state that belongs to the film, if both come from a checkpoint. Each pass calls
  /// `before_lights` between its camera paths and its light paths; it may be null.
  PassLoop(const RenderPlan& plan, PassState pass, Film& film, PassRunner& runner,
           RenderCosts& costs, Watch& watch, std::function<void()> before_lights = nullptr);

  void run();
  RenderStatus status() const;
  /// State of the pass. Contract: while no worker runs.
  const PassState& pass() const { return pass_; }
  const AllotmentFacts& allotment() const { return allotment_; }

 private:
  /// Plans the remaining light paths of the pass; empty if the render has none.
  PassPlan light_plan() const;
  /// Sets up the next pass. Returns false if the image is finished.
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
  std::vector<uint32_t> light_order_;  ///< Morton order of light path numbers
  AllotmentFacts allotment_;
  Clock::time_point start_ = Clock::now();
  uint64_t resumed_samples_ = 0;
  double samples_per_s_ = 0;  ///< speed of the last pass
  std::atomic<bool> may_be_cut_{false};
  std::atomic<uint32_t> passes_{0};
  std::atomic<uint64_t> expected_samples_{0}, active_pixels_{0};
  std::atomic<double> error_{std::numeric_limits<double>::infinity()};
};

}  // namespace wavecomb
