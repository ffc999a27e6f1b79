// SPDX-License-Identifier: Apache-2.0
/// Wave integrator: each worker runs waves in separate buffers, with the kernels of one lane width.
#pragma once

#include <memory>
#include <vector>

#include "wavecomb/wave/wave.h"

namespace wavecomb {

class WaveIntegrator final : public Integrator {
 public:
  using RunWave = void (*)(Wave&, const WaveContext&, const WaveTask&);

  /// `run_wave` is the wave function for `lanes` lanes. A wave has at most `wave_size` paths.
  WaveIntegrator(const WaveContext& context, RunWave run_wave, uint32_t lanes, uint32_t threads,
                 uint32_t wave_size);

  void run(size_t worker, const WaveTask& task) override;
  WorkerView worker(size_t i) const override;
  uint32_t lanes() const override { return lanes_; }

 private:
  const WaveContext& context_;
  RunWave run_wave_;
  uint32_t lanes_, wave_size_;
  /// Indexed by worker. The thread of each worker allocates the worker's wave.
  std::vector<std::unique_ptr<Wave>> waves_;
};

}  // namespace wavecomb
