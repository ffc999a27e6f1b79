// SPDX-License-Identifier: Apache-2.0
/// The wave integrator: each worker runs its waves on buffers of its own, with the kernels of one
/// lane width.
#pragma once

#include <memory>
#include <vector>

#include "wavecomb/integrate/wave.h"

namespace wavecomb {

class WaveIntegrator final : public Integrator {
 public:
  using RunWave = void (*)(Wave&, const WaveContext&, const WaveTask&);

  /// `run_wave`: of `lanes` lanes. Waves have `wave_size` paths at most.
  WaveIntegrator(const WaveContext& context, RunWave run_wave, uint32_t lanes, uint32_t threads,
                 uint32_t wave_size);

  void run(size_t worker, const WaveTask& task) override;
  WorkerView worker(size_t i) const override;
  uint32_t lanes() const override { return lanes_; }

 private:
  const WaveContext& context_;
  RunWave run_wave_;
  uint32_t lanes_, wave_size_;
  std::vector<std::unique_ptr<Wave>> waves_;  ///< by worker, made by its own thread
};

}  // namespace wavecomb
