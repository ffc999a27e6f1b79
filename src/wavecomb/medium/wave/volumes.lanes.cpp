// SPDX-License-Identifier: Apache-2.0
// Waves through volumes. This file is compiled once for each lane width, with WAVECOMB_LANES set to
// the width.
#include "wavecomb/medium/wave/volumes.h"

#include <bit>
#include <cstring>

#include "wavecomb/wave/kernels/shared_kernels.h"
#include "wavecomb/wave/run_wave.h"

namespace wavecomb {

WAVECOMB_SHARED_KERNELS(extern, Lanes<WAVECOMB_LANES>);

template <size_t W>
void run_wave_in_volumes(Wave& wave, const WaveContext& context, const WaveTask& task) {
  run_wave_through<Lanes<W>>(wave, context, task,
                             Volumes(context, wave.counts, wave.walks, wave.nested_media));
}
template void run_wave_in_volumes<WAVECOMB_LANES>(Wave&, const WaveContext&, const WaveTask&);

}  // namespace wavecomb
