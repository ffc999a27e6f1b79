// SPDX-License-Identifier: Apache-2.0
/// Interface to record the rays that a render traces.
#pragma once

#include <cstdint>

#include "wavecomb/accel/embree_accelerator.h"

namespace wavecomb {

/// Receives the rays of every wave as they are traced: one call per wave stage, in traversal order.
///
/// Contract: all workers call the recorder concurrently, but calls with the same `wave`, the
/// address of the worker's buffers, never overlap. The arrays are valid only during the call. Calls
/// are made once per stage, not per ray. A recorder may allocate and throw, since it serves
/// measurements only. The reference integrator, which traces single rays, does not call recorders.
class RayRecorder {
 public:
  virtual ~RayRecorder() = default;
  /// Receives rays before their closest hits are found. Depth 0, the camera rays, starts a wave.
  /// `coherent` is the hint for EmbreeAccelerator.
  virtual void closest(const void* wave, const RaySpan& rays, uint32_t depth, bool coherent) = 0;
  /// Receives the shadow rays from the hits at `depth`.
  virtual void occluded(const void* wave, const RaySpan& rays, uint32_t depth, bool coherent) = 0;
};

}  // namespace wavecomb
