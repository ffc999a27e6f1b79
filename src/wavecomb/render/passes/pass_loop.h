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
#include "wavecomb/render/joint_transport.h"
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
  /// `pass` is the state that belongs to the film, if both come from a checkpoint. Each pass traces
  /// the paths of `joint` after its camera paths.
  PassLoop(const RenderPlan& plan, PassState pass, Film& film, PassRunner& runner,
           RenderCosts& costs, Watch& watch, JointPasses& joint);

  void run();
  RenderStatus status() const;
  /// State of the pass. Contract: called while no worker runs.
  const PassState& pass() const { return pass_; }
  const AllocationStatistics& allocation() const { return allocation_; }

 private:
  /// Sets up the next pass. Returns false if the image is finished.
  bool begin_pass(std::span<const uint32_t> samples);
  bool is_past_deadline() const;
  double seconds() const;

  const Settings& settings_;
  PassRules rules_;
  PassState pass_;
  Film& film_;
  PassRunner& runner_;
  RenderCosts& costs_;
  Watch& watch_;
  JointPasses& joint_;
  std::vector<uint32_t> order_;
  AllocationStatistics allocation_;
  Clock::time_point start_ = Clock::now();
  uint64_t resumed_samples_ = 0;
  double samples_per_s_ = 0;  ///< speed of the last pass
  std::atomic<bool> may_be_cut_{false};
  std::atomic<uint32_t> passes_{0};
  std::atomic<uint64_t> expected_samples_{0}, active_pixels_{0};
  std::atomic<double> error_{std::numeric_limits<double>::infinity()};
};

}  // namespace wavecomb
