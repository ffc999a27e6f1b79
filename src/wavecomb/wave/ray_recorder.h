// SPDX-License-Identifier: Apache-2.0
/// Interface to record the rays that a render traces.
#pragma once

#include <cstdint>

#include "wavecomb/accel/embree_accelerator.h"

namespace wavecomb {

/// Interface that receives the rays of every wave. Each wave stage that traces rays makes one call,
/// with the rays in traversal order.
///
/// Contract: all workers call the recorder concurrently. `wave` is the address of the worker's
/// buffers, and calls with the same `wave` never overlap. The arrays are valid only during the
/// call. A recorder may allocate memory and throw exceptions, since it is used only for
/// measurements. The reference integrator, which traces single rays, does not call recorders.
class RayRecorder {
 public:
  virtual ~RayRecorder() = default;
  /// Receives path rays before traversal. Rays at depth 0 are the camera rays of a new wave.
  /// `coherent` is the coherence hint that EmbreeAccelerator gets.
  virtual void closest(const void* wave, const RaySpan& rays, uint32_t depth, bool coherent) = 0;
  /// Receives the shadow rays from the hits at `depth`.
  virtual void occluded(const void* wave, const RaySpan& rays, uint32_t depth, bool coherent) = 0;
};

}  // namespace wavecomb
