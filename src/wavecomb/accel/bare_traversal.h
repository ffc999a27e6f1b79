// SPDX-License-Identifier: Apache-2.0
/// Embree alone: the limit that tracing is measured against.
#pragma once

#include "wavecomb/accel/embree_accelerator.h"

namespace wavecomb {

/// Traces rays by a plain loop around rtcIntersect and rtcOccluded: no filter, nothing stored but
/// the number of hits. Built as a render builds its hierarchy, by the same code, from the same
/// arrays; partly present surfaces are opaque here. For benchmarks.
///
/// Contract: reads the Scene's arrays without copies and shares its ownership; tracing is
/// thread-safe. Columns of rays are padded by a packet, as those of SoaBlock are.
class BareTraversal {
 public:
  /// Builds with up to `threads` threads (0: all). Throws Error when Embree refuses.
  BareTraversal(std::shared_ptr<const Scene> scene, uint32_t threads);

  /// How many rays hit something. `width`: rays per call, 1, 4, 8 or 16.
  size_t intersect(const RaySpan& rays, uint32_t width, bool coherent) const;
  /// How many rays are blocked before tfar.
  size_t occluded(const RaySpan& rays, uint32_t width, bool coherent) const;
  /// Widest packets that Embree traces natively here.
  uint32_t native_width() const { return accel_.native_width(); }

 private:
  EmbreeAccelerator accel_;
};

}  // namespace wavecomb
