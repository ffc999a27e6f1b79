// SPDX-License-Identifier: Apache-2.0
/// Plain Embree traversal, the upper bound for tracing benchmarks.
#pragma once

#include "wavecomb/accel/embree_accelerator.h"

namespace wavecomb {

/// Traces rays in a plain loop around rtcIntersect and rtcOccluded without filters, and stores only
/// the number of hits. The BVH equals the BVH of a render: it is built by the same code from the
/// same arrays. Surfaces with partial presence are treated as opaque. For benchmarks.
///
/// Contract: reads the Scene's arrays without copies and shares its ownership; tracing is
/// thread-safe. Ray columns must be padded by one packet, as in SoaBlock.
class BareTraversal {
 public:
  /// Builds the BVH with up to `threads` threads; 0 means all threads. Throws Error if Embree
  /// fails.
  BareTraversal(std::shared_ptr<const Scene> scene, uint32_t threads);

  /// Returns the number of rays that hit something. `width`: rays per call, 1, 4, 8 or 16.
  size_t intersect(const RaySpan& rays, uint32_t width, bool coherent) const;
  /// Returns the number of rays that are occluded before tfar.
  size_t occluded(const RaySpan& rays, uint32_t width, bool coherent) const;
  /// Returns the width of the widest packet that Embree traces natively on this CPU.
  uint32_t native_width() const { return accel_.native_width(); }

 private:
  EmbreeAccelerator accel_;
};

}  // namespace wavecomb
