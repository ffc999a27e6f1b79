// SPDX-License-Identifier: Apache-2.0 Kernels of the shading program "volume". This file is
// This file is compiled once for each lane width, with WAVECOMB_LANES set to the width.
#include "wavecomb/medium/volume/volume_bsdf.h"

#include "wavecomb/wave/kernels/shared_kernels.h"
#include "wavecomb/wave/stages/shade_batch.h"

namespace wavecomb {

using VolumeLanes = Lanes<WAVECOMB_LANES>;

WAVECOMB_SHARED_KERNELS(extern, VolumeLanes);

template void shade_batch<VolumeBsdf<VolumeLanes>, VolumeLanes, kEverything, JointTransport>(
    Wave&, const WaveContext&, const ShadeSettings&, uint32_t, size_t, size_t);
#if WAVECOMB_LANES == 1
// The reference integrator uses this scalar instantiation.
template VertexResult<float> shade_vertex<VolumeBsdf<float>, float, kEverything, JointTransport>(
    const Vertex<float>&, JointTransport::Coupling<float>&);
#endif

}  // namespace wavecomb
