// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

namespace wavecomb {

/// Wave parameters of a render. The parameters do not change the image.
struct WaveSetup {
  uint32_t lanes;
  uint32_t threads;
  uint32_t wave_size;  ///< paths in a wave
};

}  // namespace wavecomb
