// SPDX-License-Identifier: Apache-2.0
// Waves through volumes. Compiled once per lane width, with WAVECOMB_LANES set to it.
#include "wavecomb/medium/volumes.h"

#include "wavecomb/integrate/run_wave.h"
#include "wavecomb/integrate/shared_kernels.h"
#include "wavecomb/integrate/stages/shade_batch.h"
#include "wavecomb/medium/volume_bsdf.h"

namespace wavecomb {

using VolumeLanes = Lanes<WAVECOMB_LANES>;

WAVECOMB_SHARED_KERNELS(extern, VolumeLanes);

template void shade_batch<VolumeBsdf<VolumeLanes>, VolumeLanes, kEverything>(
    Wave&, const WaveContext&, const ShadeSettings&, uint32_t, size_t, size_t);
#if WAVECOMB_LANES == 1
template VertexResult<float> shade_vertex<VolumeBsdf<float>, float, kEverything>(
    const Vertex<float>&);
#endif

template <size_t W>
void run_wave_in_volumes(Wave& wave, const WaveContext& context, const WaveTask& task) {
  run_wave_through<Lanes<W>>(wave, context, task, Volumes(context.scene.volumes));
}
template void run_wave_in_volumes<WAVECOMB_LANES>(Wave&, const WaveContext&, const WaveTask&);

}  // namespace wavecomb
