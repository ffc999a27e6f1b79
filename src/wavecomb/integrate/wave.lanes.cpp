// SPDX-License-Identifier: Apache-2.0
// Compiled once per lane width, with WAVECOMB_LANES set to it.
#include "wavecomb/integrate/stages/collect.h"
#include "wavecomb/integrate/stages/generate.h"
#include "wavecomb/integrate/stages/order.h"
#include "wavecomb/integrate/stages/resolve.h"
#include "wavecomb/integrate/stages/shade.h"
#include "wavecomb/integrate/stages/trace.h"

namespace wavecomb {

template <size_t W>
void run_wave(Wave& wave, const WaveContext& context, const WaveTask& task) {
  using F = Lanes<W>;
  const ShadeSettings settings(*context.settings);
  PhaseClock& clock = wave.clock;
  clock.start(Phase::kGenerate);
  const float* tfar = generate<F>(wave, context, task);
  wave.counts.samples += task.path_count();
  for (uint32_t depth = 0; wave.rays.size > 0; ++depth) {
    clock.enter(Phase::kTrace);
    trace(wave, context, depth, depth == 0 ? tfar : nullptr);
    clock.enter(Phase::kShade);
    collect<F>(wave, context, settings, depth);
    order_records(wave, context, depth);
    clock.enter(Phase::kShade);
    shade<F>(wave, context, settings, depth);
    compact<F>(wave);
    clock.enter(Phase::kShadow);
    shadow<F>(wave, context, depth);
  }
  clock.enter(Phase::kResolve);
  resolve(wave, context, task);
  clock.stop();
}

template void run_wave<WAVECOMB_LANES>(Wave&, const WaveContext&, const WaveTask&);

}  // namespace wavecomb
