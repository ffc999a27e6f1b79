// SPDX-License-Identifier: Apache-2.0
/// Ray traversal with Embree's functions alone, whose speed is the upper bound in benchmarks of ray
/// tracing.
#pragma once

#include "wavecomb/accel/embree_accelerator.h"

namespace wavecomb {

/// Ray tracer for benchmarks, which calls rtcIntersect and rtcOccluded in a loop, without filter
/// functions, and only counts hits. The BVH is the same as in a render, since the same code builds
/// it from the same arrays. Surfaces with partial presence are treated as opaque.
///
/// Contract: the object reads the scene's arrays without copying them and keeps the scene alive.
/// Several threads can trace rays at the same time. The arrays of a `RaySpan` must be readable for
/// one packet of rays past the end, as the arrays of a `SoaBlock` are.
class BareTraversal {
 public:
  /// Builds the BVH with up to `threads` threads; 0 means all threads. Throws Error if Embree
  /// fails.
  BareTraversal(std::shared_ptr<const Scene> scene, uint32_t threads);

  /// Returns the number of rays that hit something. `width` is the number of rays per Embree call:
  /// 1, 4, 8 or 16.
  size_t intersect(const RaySpan& rays, uint32_t width, bool coherent) const;
  /// Returns the number of rays that hit something before their `tfar`.
  size_t occluded(const RaySpan& rays, uint32_t width, bool coherent) const;
  /// Returns the width of the widest packet that Embree traces natively on this CPU.
  uint32_t native_width() const { return accel_.native_width(); }

 private:
  EmbreeAccelerator accel_;
};

}  // namespace wavecomb
