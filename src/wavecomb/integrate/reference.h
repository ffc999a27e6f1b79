// SPDX-License-Identifier: Apache-2.0
/// The oracle: one path at a time, depth first, one lane, single rays.
#pragma once

#include "wavecomb/integrate/wave.h"

namespace wavecomb {

/// Runs the paths of `task` one after another with the same kernels as a wave and adds them to the
/// film in the same order. No queue, no schedule, no packet: what every wave must equal, bit for
/// bit.
void run_reference(const WaveContext& context, const WaveTask& task, PhaseClock& clock,
                   Counts& counts);

}  // namespace wavecomb
