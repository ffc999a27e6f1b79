// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/integrate/shared_kernels.h"

#include "wavecomb/curve/surface.inl"
#include "wavecomb/graph/hit_point.inl"
#include "wavecomb/graph/run.inl"
#include "wavecomb/learn/guide.inl"
#include "wavecomb/light/emission.inl"
#include "wavecomb/light/light.inl"
#include "wavecomb/surface/inputs.inl"
#include "wavecomb/surface/motion.inl"
#include "wavecomb/texture/lookup.inl"

namespace wavecomb {

WAVECOMB_SHARED_KERNELS(, Lanes<WAVECOMB_LANES>);

}  // namespace wavecomb
