// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/integrate/shared_kernels.h"

namespace wavecomb {

WAVECOMB_SHARED_KERNELS(, Lanes<WAVECOMB_LANES>);

}  // namespace wavecomb
