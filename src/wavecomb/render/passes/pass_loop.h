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

/// Renders passes until the goal of the settings is reached, which is a number of samples, an error
/// or a time.
///
/// Contract: one thread calls run(), within the arena of the PassRunner. Any thread may call
/// status(). Without a time limit, the rendered samples depend only on film, settings and pass.
class PassLoop {
 public:
  /// `pass` is the pass state of the checkpoint from which the film was restored, or a new state.
  /// Each pass traces the paths of `joint` after its camera paths.
  PassLoop(const RenderPlan& plan, PassState pass, Film& film, PassRunner& runner,
           RenderCosts& costs, Watch& watch, JointPasses& joint);

  void run();
  RenderStatus status() const;
  /// Returns the state of the current pass. Contract: no worker runs during the call.
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
  double samples_per_s_ = 0;  ///< rendering speed in the last pass
  std::atomic<bool> may_be_cut_{false};
  std::atomic<uint32_t> passes_{0};
  std::atomic<uint64_t> expected_samples_{0}, active_pixels_{0};
  std::atomic<double> error_{std::numeric_limits<double>::infinity()};
};

}  // namespace wavecomb
