// SPDX-License-Identifier: Apache-2.0
/// Interface of integrators. A render owns one integrator, and all workers submit their tasks to
/// this integrator.
#pragma once

#include <cstddef>
#include <cstdint>

namespace wavecomb {

class Chooser;
class CostTracker;
class PhaseClock;
struct CoherenceCounts;
struct Counts;

/// Task of a worker: trace the samples [first_sample, first_sample + samples) of `pixels`. A pixel
/// is encoded as x | y << 16.
struct WaveTask {
  const uint32_t* pixels;
  uint32_t pixel_count;
  uint32_t first_sample;
  uint32_t samples;
  /// Whether to trace paths of the joint transport (joint_transport.h) instead of camera paths.
  /// Pixel and sample then only identify a path, which may contribute to any pixel.
  bool joint = false;
  uint32_t path_count() const { return pixel_count * samples; }
};

/// Statistics and training data of a worker. A pointer is null if the integrator does not collect
/// the data it points to. All members except `counts` may be read only while the worker is idle;
/// the worker's thread may read `counts` at any time.
struct WorkerView {
  const PhaseClock* clock = nullptr;
  const Counts* counts = nullptr;
  const CoherenceCounts* coherence = nullptr;
  const Chooser* policies = nullptr;  ///< number of times the worker used each policy
  CostTracker* costs = nullptr;
  size_t bytes = 0;  ///< size of the worker's buffers
};

/// Estimates the image by tracing the tasks that workers submit.
///
/// Contract: one thread calls begin_pass() and end_pass() while no wave runs. Workers call run()
/// concurrently, each from one thread at a time. run() writes only the film pixels of its task, and
/// adds the samples of a pixel in sample order. Paths of a joint transport may
/// contribute to any pixel.
class Integrator {
 public:
  virtual ~Integrator() = default;

  virtual void begin_pass() {}
  /// Traces all paths of a task.
  virtual void run(size_t worker, const WaveTask& task) = 0;
  virtual void end_pass() {}

  /// Returns the statistics of worker `i`. All pointers are null before the first task of the
  /// worker.
  virtual WorkerView worker(size_t i) const = 0;
  /// Returns the number of SIMD lanes of the kernels.
  virtual uint32_t lanes() const = 0;
};

}  // namespace wavecomb
