// SPDX-License-Identifier: Apache-2.0
// Program "openpbr" on its own, so that its size changes nothing in how the others are compiled.
#include "wavecomb/integrate/stages/shade.h"

namespace wavecomb {

template void shade_batch<OpenPbrBsdf<Lanes<WAVECOMB_LANES>>, Lanes<WAVECOMB_LANES>>(
    Wave&, const WaveContext&, const ShadeSettings&, uint32_t, size_t, size_t);

}  // namespace wavecomb
