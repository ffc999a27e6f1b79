// SPDX-License-Identifier: Apache-2.0
/// Progress of a render.
#pragma once

#include <cstdint>
#include <limits>

namespace wavecomb {

/// Progress of a render.
struct RenderStatus {
  uint64_t samples_done = 0;  ///< samples rendered so far, including samples from a checkpoint
  uint64_t resumed_samples = 0;
  uint64_t samples_total = 0;  ///< samples of the whole render; an estimate if adaptive or timed
  uint64_t rays = 0;           ///< rays of all kinds since the render began or was resumed
  uint32_t passes = 0;         ///< begun
  uint64_t active_pixels = 0;  ///< active pixels in the current pass
  double seconds = 0;          ///< time since the render began or was resumed
  /// Mean relative error of the image at the last check, or infinite if unknown.
  double error = std::numeric_limits<double>::infinity();
};

}  // namespace wavecomb
