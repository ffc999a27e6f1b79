// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/wave/kernels/shared_kernels.h"

#include "wavecomb/geometry/hit/curve_surface.inl"
#include "wavecomb/geometry/hit/motion.inl"
#include "wavecomb/graph/run.inl"
#include "wavecomb/guiding/lookup.inl"
#include "wavecomb/light/emission/emission.inl"
#include "wavecomb/light/sampling/light_sample.inl"
#include "wavecomb/material/inputs/graph_inputs.inl"
#include "wavecomb/material/inputs/inputs.inl"
#include "wavecomb/texture/lookup.inl"

namespace wavecomb {

WAVECOMB_SHARED_KERNELS(, Lanes<WAVECOMB_LANES>);

}  // namespace wavecomb
