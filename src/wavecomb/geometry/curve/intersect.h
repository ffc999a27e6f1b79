// SPDX-License-Identifier: Apache-2.0
/// Intersection of rays with curves and points.
///
/// Rays are tested one at a time in double precision, so that hits do not depend on other rays
/// (docs/decisions/curves.md).
#pragma once

#include <array>
#include <cstdint>

#include "wavecomb/geometry/curve/ray.h"
#include "wavecomb/geometry/mesh/mesh.h"
#include "wavecomb/scene/scene.h"

namespace wavecomb {

/// Hit on a curve or point; u and v are defined in geometry/curve/segment.h.
struct CurveHit {
  float t, u, v;
};

/// Hits of a ray on one primitive, sorted by distance.
class CurveHits {
 public:
  static constexpr uint32_t kMax = 8;  ///< maximum number of hits; only the nearest are kept

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

/// Sub-segment: node 1 is the whole segment; nodes 2 n and 2 n + 1 are the halves of n in
/// parameter.
struct SubSegment {
  static constexpr uint32_t kNodes = 8;  ///< upper bound of node indices

  uint32_t prim;
  uint32_t node = 1;
};

/// Type of query: the first hit, all hits, or whether there is any hit (for which u and v are not
/// computed).
enum class CurveQuery { kFirst, kAll, kAny };

/// Returns conservative bounds of primitive `prim` of a mesh of curves or points at a motion step.
Bounds curve_bounds(const Mesh& mesh, uint32_t prim, uint32_t step = 0);

/// Returns hits with 0 < t <= tfar, t in units of |dir|, on the outside and inside of a primitive
/// of a mesh of curves or points. End caps of tubes that lie inside the adjoining segment are not
/// hit. `time` is in [0, 1], over the mesh's motion steps. If `outside`, hits on the inside of
/// tubes are skipped. Returns all hits on the given sub-segment and possibly further hits on its
/// segment; hits are bit-identical to the hits of a query for the whole segment.
CurveHits intersect_curve(const Mesh& mesh, const SubSegment& sub_segment, const CurveRay& ray,
                          float tfar, CurveQuery query, float time = 0, bool outside = false);

}  // namespace wavecomb
