// SPDX-License-Identifier: Apache-2.0
/// Ray traversal that uses only Embree's functions. Benchmarks of ray tracing use its speed as the
/// upper bound.
#pragma once

#include "wavecomb/accel/embree_accelerator.h"

namespace wavecomb {

/// Ray tracer for benchmarks, which calls rtcIntersect and rtcOccluded in a loop, without filter
/// functions, and only counts hits. The BVH is the same as in a render, since the same code builds
/// it from the same arrays. Partially transparent surfaces (opacity below 1) are treated as opaque.
///
/// Contract: the object reads the scene's arrays without copying them and keeps the scene alive.
/// Several threads can trace rays at the same time. It must be possible to read the arrays of a
/// `RaySpan` up to one packet of rays past the end, as with the padded arrays of a `SoaBlock`.
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
