// SPDX-License-Identifier: Apache-2.0
/// Where a render may leave the rays that it traces.
#pragma once

#include <cstdint>

#include "wavecomb/accel/embree_accelerator.h"

namespace wavecomb {

/// Gets the rays of every wave as they go to the accelerator: stage by stage, in traversal order.
///
/// Contract: called by all workers at once, but by one at a time for a given `wave`, which is the
/// address of the worker's buffers. The arrays hold only during the call. Called once a stage,
/// never a ray; may allocate and throw, since it is there only while something is measured. The
/// reference integrator, which traces rays one by one, does not call it.
class RayRecorder {
 public:
  virtual ~RayRecorder() = default;
  /// Rays whose closest hits are asked for; depth 0, the camera's, begins a wave. `coherent`: as
  /// EmbreeAccelerator is told.
  virtual void closest(const void* wave, const RaySpan& rays, uint32_t depth, bool coherent) = 0;
  /// Shadow rays from the hits of `depth`.
  virtual void occluded(const void* wave, const RaySpan& rays, uint32_t depth, bool coherent) = 0;
};

}  // namespace wavecomb
