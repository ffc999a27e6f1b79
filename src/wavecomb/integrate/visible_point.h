// SPDX-License-Identifier: Apache-2.0
/// Points that the camera sees in mirrors and through glass, and the paths from lights that end
/// near them (docs/light-paths.md, "Merging").
///
/// A camera path whose bounces so far were deltas, one or more, leaves a point at the first vertex
/// that scatters otherwise, too. A path from a light cannot be shown to the camera through a
/// mirror; but one whose vertex lies within r of the point, r in pixels as they are seen there, is
/// taken to end at it. Such points are the eye's (T. Hachisuka et al., "Progressive Photon
/// Mapping", 2008), and light is splatted to their pixels: sums of integers, whatever the order.
///
/// A pass has one sample of each pixel, which leaves one point at most; paths from lights come
/// after all of them.
#pragma once

#include <cstring>

#include "wavecomb/core/fields.h"
#include "wavecomb/core/soa.h"
#include "wavecomb/core/vec3.h"

namespace wavecomb {

/// A point, as a row.
template <typename F>
struct VisiblePoint {
  Vec3<F> p;
  F radius;        ///< 0: there is none
  Vec3<F> w;       ///< unit, to where it is seen from
  UInt<F> normal;  ///< pack_normal of the geometric one
  Color<F> light;  ///< of the pixel, for a unit of radiance along w, before the exposure
  UInt<F> depth;   ///< vertices of the camera's path before it
  WAVECOMB_FIELDS(p, radius, w, normal, light, depth)
};
inline constexpr size_t kVisibleWords = kRowWords<VisiblePoint>;

/// What a vertex of a camera path leaves.
template <typename F>
struct VisibleOffer {
  VisiblePoint<F> row;
  Mask<F> seen{false};  ///< lanes that leave something
};

/// Contract: owned by one wave or one reference integrator, a row a slot.
class VisibleRows {
 public:
  VisibleRows() = default;
  /// `capacity` 0: nothing is merged.
  explicit VisibleRows(size_t capacity)
      : block_(capacity > 0 ? SoaBlock(1, capacity * kVisibleWords) : SoaBlock()) {
    if (capacity > 0) rows = block_.floats(0);
  }

  explicit operator bool() const { return rows != nullptr; }
  size_t bytes() const { return block_.bytes(); }
  /// Forgets the points of slots below `slots`.
  void clear(size_t slots) const { std::memset(rows, 0, slots * kVisibleWords * sizeof(float)); }
  const float* row(size_t slot) const { return rows + slot * kVisibleWords; }

  float* rows = nullptr;

 private:
  SoaBlock block_;
};

}  // namespace wavecomb
