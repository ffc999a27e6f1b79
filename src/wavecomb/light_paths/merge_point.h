// SPDX-License-Identifier: Apache-2.0
/// Points that the camera sees in mirrors and through glass, for merging with light paths
/// (docs/light-paths.md, "Merging").
///
/// A camera path stores a merge point at its first vertex with a non-delta lobe, if it has had at
/// least one bounce and only delta bounces. A light path cannot connect to the camera through a
/// mirror. Instead, a light path with a vertex within a distance r of the merge point is treated as
/// if it ended at the merge point. The setting gives r in pixels. Merge points are the visible
/// points of progressive photon mapping (T. Hachisuka et al., "Progressive Photon Mapping", 2008).
/// Contributions at merge points are added to their pixels as integers, so the order of additions
/// does not matter.
///
/// With merging, a pass has one sample for each pixel, and each sample stores at most one point.
/// The light paths of the pass are traced after all its camera paths.
#pragma once

#include <cstring>
#include <span>

#include "wavecomb/core/rows/fields.h"
#include "wavecomb/core/rows/soa.h"
#include "wavecomb/core/vec3.h"

namespace wavecomb {

/// Row of a merge point.
template <typename F>
struct MergePoint {
  Vec3<F> p;
  F radius;        ///< merge radius; 0 if there is no point
  Vec3<F> w;       ///< unit vector towards the viewer
  UInt<F> normal;  ///< geometric normal, packed by pack_normal()
  Color<F> light;  ///< contribution to the pixel for unit radiance along w, before exposure
  UInt<F> depth;   ///< number of vertices of the camera path before the point
  WAVECOMB_FIELDS(p, radius, w, normal, light, depth)
};
inline constexpr size_t kMergePointWords = kRowWords<MergePoint>;

/// Merge point that a vertex of a camera path may store.
template <typename F>
struct MergePointOffer {
  MergePoint<F> row;
  Mask<F> stored{false};  ///< lanes that store a merge point
};

/// Merge points of the camera paths of a wave.
///
/// Contract: each object belongs to a single wave or reference integrator. Each slot has one row.
class MergePointRows {
 public:
  MergePointRows() = default;
  /// Allocates rows for `capacity` slots; 0 disables merging.
  explicit MergePointRows(size_t capacity)
      : block_(capacity > 0 ? SoaBlock(1, capacity * kMergePointWords) : SoaBlock()) {
    if (capacity > 0) rows = block_.floats(0);
  }

  explicit operator bool() const { return rows != nullptr; }
  size_t bytes() const { return block_.bytes(); }
  /// Clears the merge points of the first `slots` slots.
  void clear(size_t slots) const { std::memset(rows, 0, slots * kMergePointWords * sizeof(float)); }
  std::span<const float> row(size_t slot) const {
    return {rows + slot * kMergePointWords, kMergePointWords};
  }

  float* rows = nullptr;

 private:
  SoaBlock block_;
};

}  // namespace wavecomb
