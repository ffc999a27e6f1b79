// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

namespace wavecomb {

/// How waves run. None of it changes an image.
struct WaveSetup {
  uint32_t lanes;
  uint32_t threads;
  uint32_t wave_size;  ///< paths of a wave
};

}  // namespace wavecomb
