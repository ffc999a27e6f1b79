// SPDX-License-Identifier: Apache-2.0
/// Progress of a render.
#pragma once

#include <cstdint>
#include <limits>

namespace wavecomb {

/// Progress of a render.
struct RenderStatus {
  uint64_t samples_done = 0;  ///< those of a checkpoint too
  uint64_t resumed_samples = 0;
  uint64_t samples_total = 0;  ///< in all; adaptive or timed: as expected by now
  uint64_t rays = 0;           ///< of all kinds, since the render began or was resumed
  uint32_t passes = 0;         ///< begun
  uint64_t active_pixels = 0;  ///< of the pass
  double seconds = 0;          ///< since the render began or was resumed
  /// Mean relative error of the picture at the last look; infinite: not known.
  double error = std::numeric_limits<double>::infinity();
};

}  // namespace wavecomb
