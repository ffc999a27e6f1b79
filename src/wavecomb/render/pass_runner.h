// SPDX-License-Identifier: Apache-2.0
/// Cuts the plan of a pass into waves and runs them on all workers.
#pragma once

#include <atomic>
#include <functional>
#include <vector>

#include "wavecomb/core/clock.h"
#include "wavecomb/integrate/integrator.h"
#include "wavecomb/render/pass_plan.h"
#include "wavecomb/render/sharing.h"

namespace wavecomb {

/// A share of a plan for one worker: pixels whose samples it renders one wave after the other, so
/// that each gets its samples in their order.
struct WaveGroup {
  const uint32_t* pixels;
  uint32_t pixel_count;
  uint32_t first_sample, samples;
  uint32_t wave_samples;  ///< of a pixel in one wave, at most
};

/// Groups for a plan. Waves are full, unless that would leave workers without any.
std::vector<WaveGroup> wave_groups(const PassPlan& plan, uint32_t wave_size, uint32_t threads);

/// Contract: run() is called on one thread, within the arena whose threads are the workers.
class PassRunner {
 public:
  PassRunner(Integrator& integrator, uint32_t threads, uint32_t wave_size);

  /// Runs a plan until it is done or `halted` says so; asked before each wave, by all workers.
  /// Every pixel then has whole waves of samples, without gaps.
  /// `from_lights`: the plan's paths start there (WaveTask::from_lights), and are no samples.
  void run(const PassPlan& plan, const std::function<bool()>& halted, bool from_lights = false);

  const Integrator& integrator() const { return integrator_; }
  uint32_t threads() const { return static_cast<uint32_t>(workers_.size()); }
  uint32_t wave_size() const { return wave_size_; }
  /// So far; may be read while waves run.
  uint64_t samples_done() const { return samples_; }
  uint64_t rays_done() const { return rays_; }
  /// Since construction, until the first wave was done.
  double first_samples_s() const { return first_samples_s_; }
  /// Of the passes that were run.
  const Sharing& sharing() const { return sharing_; }

 private:
  void run_wave(const WaveTask& task);

  Integrator& integrator_;
  uint32_t wave_size_;
  std::vector<char> workers_;  ///< one for each worker, by whose addresses they are told apart
  std::atomic<uint64_t> samples_{0}, rays_{0};
  Clock::time_point start_ = Clock::now();
  double first_samples_s_ = 0;
  Sharing sharing_;
};

}  // namespace wavecomb
