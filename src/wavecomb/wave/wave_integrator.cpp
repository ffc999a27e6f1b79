// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/wave/wave_integrator.h"
#include "wavecomb/core/settings.h"

namespace wavecomb {

bool WaveContext::orders_rays() const {
  return settings->ray_order != RayOrder::kSlot || settings->shadow_order != RayOrder::kSlot;
}

WaveIntegrator::WaveIntegrator(const WaveContext& context, RunWave run_wave, uint32_t lanes,
                               uint32_t threads, uint32_t wave_size)
    : context_(context),
      run_wave_(run_wave),
      lanes_(lanes),
      wave_size_(wave_size),
      waves_(threads) {}

void WaveIntegrator::run(size_t worker, const WaveTask& task) {
  std::unique_ptr<Wave>& wave = waves_[worker];
  if (!wave) wave = std::make_unique<Wave>(wave_size_, context_);
  run_wave_(*wave, context_, task);
}

WorkerView WaveIntegrator::worker(size_t i) const {
  if (!waves_[i]) return {};
  Wave& wave = *waves_[i];
  return {&wave.clock,          &wave.counts, &wave.coherence,
          &wave.policy_chooser, &wave.costs,  wave.bytes()};
}

}  // namespace wavecomb
