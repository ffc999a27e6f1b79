// SPDX-License-Identifier: Apache-2.0
/// Rays against curves and points.
///
/// One ray at a time and in double precision: what a ray hits does not depend on the rays beside it
/// (docs/decisions/curves.md).
#pragma once

#include <array>
#include <cstdint>

#include "wavecomb/curve/ray.h"
#include "wavecomb/scene/mesh.h"
#include "wavecomb/scene/scene.h"

namespace wavecomb {

/// Where a ray meets a curve or point, u and v as curve/segment.h has them.
struct CurveHit {
  float t, u, v;
};

/// Hits of a ray on one primitive, nearest first.
class CurveHits {
 public:
  static constexpr uint32_t kMost = 8;  ///< of more than these, the farthest are forgotten

  void add(const CurveHit& hit) {
    if (count_ == kMost && !(hit.t < hits_[kMost - 1].t)) return;
    uint32_t at = count_ < kMost ? count_++ : kMost - 1;
    for (; at > 0 && hit.t < hits_[at - 1].t; --at) hits_[at] = hits_[at - 1];
    hits_[at] = hit;
  }
  bool empty() const { return count_ == 0; }
  const CurveHit* begin() const { return hits_.data(); }
  const CurveHit* end() const { return hits_.data() + count_; }

 private:
  std::array<CurveHit, kMost> hits_;
  uint32_t count_ = 0;
};

/// A part of a segment: 1 is all of it, 2 n and 2 n + 1 are the halves of n by parameter.
struct CurvePiece {
  static constexpr uint32_t kNodes = 8;  ///< nodes are less than this

  uint32_t prim;
  uint32_t node = 1;
};

/// What is asked of a curve: its first hit, all of them, or whether there is one (whose u and v are
/// then not worked out).
enum class CurveQuery { kFirst, kAll, kAny };

/// A box around primitive `prim` of a mesh of curves or points, a little larger than it, at one of
/// the mesh's steps.
Bounds curve_bounds(const Mesh& mesh, uint32_t prim, uint32_t step = 0);

/// Hits with 0 < t <= tfar, t in units of |dir|, on the outside and inside of a primitive of a mesh
/// of curves or points. Where a tube goes on in the next segment, the end that
/// lies in it is not hit. `time`: in [0, 1] over the mesh's steps. `outside`: what is met from
/// inside is left out. Of a piece: those on it, and maybe others; they are the same numbers as
/// those that its primitive gives.
CurveHits intersect_curve(const Mesh& mesh, const CurvePiece& piece, const CurveRay& ray,
                          float tfar, CurveQuery query, float time = 0, bool outside = false);

}  // namespace wavecomb
