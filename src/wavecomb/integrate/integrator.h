// SPDX-License-Identifier: Apache-2.0
/// What estimates the picture. A render owns one integrator; workers ask it for one wave after the
/// other.
#pragma once

#include <cstddef>
#include <cstdint>

namespace wavecomb {

class Chooser;
class CostTracker;
class PhaseClock;
struct CoherenceCounts;
struct Counts;

/// Pixels (x | y << 16) and their samples [first_sample, first_sample + samples).
struct WaveTask {
  const uint32_t* pixels;
  uint32_t pixel_count;
  uint32_t first_sample;
  uint32_t samples;
  /// Paths start at lights: that of a pixel is one of as many, and says nothing of the pixel.
  bool from_lights = false;
  uint32_t path_count() const { return pixel_count * samples; }
};

/// What a worker has counted and learnt; null where it has nothing of the kind. Read while the
/// worker stands still, but for `counts`, which its own thread may read at any time.
struct WorkerView {
  const PhaseClock* clock = nullptr;
  const Counts* counts = nullptr;
  const CoherenceCounts* coherence = nullptr;
  const Chooser* policies = nullptr;  ///< which policy it used how often
  CostTracker* costs = nullptr;
  size_t bytes = 0;  ///< of its buffers
};

/// Contract: begin_pass, end_pass: one thread, while no wave runs. run: one thread a worker at a
/// time, workers side by side; writes the task's own pixels of the film, and adds a pixel's samples
/// in the order of their numbers.
class Integrator {
 public:
  virtual ~Integrator() = default;

  virtual void begin_pass() {}
  /// Renders a task to its end.
  virtual void run(size_t worker, const WaveTask& task) = 0;
  virtual void end_pass() {}

  /// Of worker `i`; all null before its first task.
  virtual WorkerView worker(size_t i) const = 0;
  /// Lanes that it computes in.
  virtual uint32_t lanes() const = 0;
};

}  // namespace wavecomb
