// SPDX-License-Identifier: Apache-2.0
/// Splits the plan of a pass into waves and runs them on all workers.
#pragma once

#include <atomic>
#include <functional>
#include <vector>

#include "wavecomb/core/clock.h"
#include "wavecomb/path/integrator.h"
#include "wavecomb/render/passes/pass_plan.h"
#include "wavecomb/render/statistics/work_distribution.h"

namespace wavecomb {

/// Group of waves: a part of a plan that one worker renders. The worker renders its waves one after
/// the other, so that each pixel gets its samples in order.
struct WaveGroup {
  const uint32_t* pixels;
  uint32_t pixel_count;
  uint32_t first_sample, samples;
  uint32_t wave_samples;  ///< maximum number of samples of a pixel in one wave
};

/// Splits a plan into groups of waves. Waves are full unless full waves would leave workers idle.
std::vector<WaveGroup> wave_groups(const PassPlan& plan, uint32_t wave_size, uint32_t threads);

/// Runs plans on an integrator.
///
/// Contract: one thread calls run(), within the arena whose threads are the workers.
class PassRunner {
 public:
  PassRunner(Integrator& integrator, uint32_t threads, uint32_t wave_size);

  /// Runs a plan until it is done or `halted` returns true. All workers call `halted` before each
  /// wave. After run(), each pixel has all samples of complete waves, without gaps. If `joint` is
  /// true, the plan consists of light paths (WaveTask::joint), which do not count as samples.
  void run(const PassPlan& plan, const std::function<bool()>& halted, bool joint = false);

  const Integrator& integrator() const { return integrator_; }
  uint32_t threads() const { return static_cast<uint32_t>(workers_.size()); }
  uint32_t wave_size() const { return wave_size_; }
  /// Number of camera samples rendered so far. This function and rays_done() may be called while
  /// waves run.
  uint64_t samples_done() const { return samples_; }
  uint64_t rays_done() const { return rays_; }
  /// Seconds from construction until the first wave was done.
  double first_samples_s() const { return first_samples_s_; }
  /// Work distribution of all passes.
  const WorkDistribution& work_distribution() const { return work_distribution_; }

 private:
  void run_wave(const WaveTask& task);

  Integrator& integrator_;
  uint32_t wave_size_;
  /// One element per worker; the element's address identifies the worker.
  std::vector<char> workers_;
  std::atomic<uint64_t> samples_{0}, rays_{0};
  Clock::time_point start_ = Clock::now();
  double first_samples_s_ = 0;
  WorkDistribution work_distribution_;
};

}  // namespace wavecomb
