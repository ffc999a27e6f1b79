// SPDX-License-Identifier: Apache-2.0
/// Intersection of rays with curves and points.
///
/// Rays are tested one at a time in double precision, so that hits do not depend on other rays
/// (docs/decisions/curves.md).
#pragma once

#include <array>
#include <cstdint>

#include "wavecomb/geometry/curve/ray.h"
#include "wavecomb/geometry/mesh/bounds.h"
#include "wavecomb/geometry/mesh/mesh.h"
#include "wavecomb/scene/scene_view.h"

namespace wavecomb {

/// Hit on a curve or point; u and v are defined in geometry/curve/segment.h.
struct CurveHit {
  float t, u, v;
};

/// Hits of a ray on one primitive, sorted by distance.
class CurveHits {
 public:
  static constexpr uint32_t kMax = 8;  ///< maximum number of hits; farther hits are dropped

  void add(const CurveHit& hit) {
    if (count_ == kMax && !(hit.t < hits_[kMax - 1].t)) return;
    uint32_t at = count_ < kMax ? count_++ : kMax - 1;
    for (; at > 0 && hit.t < hits_[at - 1].t; --at) hits_[at] = hits_[at - 1];
    hits_[at] = hit;
  }
  bool empty() const { return count_ == 0; }
  const CurveHit* begin() const { return hits_.data(); }
  const CurveHit* end() const { return hits_.data() + count_; }

 private:
  std::array<CurveHit, kMax> hits_;
  uint32_t count_ = 0;
};

/// Part of a curve segment, identified by a node of a binary tree. Node 1 is the whole segment, and
/// the nodes 2 n and 2 n + 1 are the two halves of node n's parameter range.
struct SubSegment {
  static constexpr uint32_t kNodes = 8;  ///< upper bound of node indices

  uint32_t prim;
  uint32_t node = 1;
};

/// Type of query: the first hit, all hits, or whether there is any hit. Queries of type kAny do not
/// compute u and v.
enum class CurveQuery { kFirst, kAll, kAny };

/// Returns a bounding box that contains the primitive `prim` of a mesh of curves or points at the
/// motion step `step`.
Bounds curve_bounds(const Mesh& mesh, uint32_t prim, uint32_t step = 0);

/// Returns the hits of a ray on a primitive of a mesh of curves or points. The distances satisfy 0
/// < t <= tfar, in units of the length of the ray direction. Rays hit the outside and the inside of
/// tubes, or only the outside if `outside` is true. They do not hit the parts of spherical ends
/// that are inside the adjoining segment. `time` is the shutter time in [0, 1]. Returns all hits on
/// the given sub-segment, and possibly further hits on the same segment. Each hit is bit-identical
/// to the hit that a query for the whole segment returns.
CurveHits intersect_curve(const Mesh& mesh, const SubSegment& sub_segment, const CurveRay& ray,
                          float tfar, CurveQuery query, float time = 0, bool outside = false);

}  // namespace wavecomb
