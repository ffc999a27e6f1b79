// SPDX-License-Identifier: Apache-2.0
/// Spatial index of the points that the camera sees in mirrors and through glass (merge_point.h),
/// for merging with light paths.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "wavecomb/film/film.h"
#include "wavecomb/light_paths/merge_point.h"

namespace wavecomb {

/// Hash grid of merge points. Each point is stored in all cells that overlap the sphere of its
/// merge radius. The cell size depends on the radius of the point.
///
/// Contract: build() must not run during searches.
class MergeGrid {
 public:
  /// Builds the grid. `points` holds a MergePoint row for each pixel and must outlive the grid.
  void build(std::span<const float> points);
  const float* points() const { return points_; }

  /// Iterates over all merge points whose sphere contains a given position.
  class Search {
   public:
    Search() = default;
    Search(const MergeGrid& grid, float x, float y, float z) : grid_(&grid), at_{x, y, z} {}
    /// Advances to the next point and returns its pixel in `pixel`. Returns false if there is no
    /// further point.
    bool next(uint32_t& pixel);

   private:
    const MergeGrid* grid_ = nullptr;
    float at_[3] = {};
    size_t level_ = 0;
    uint32_t begin_ = 0, end_ = 0;
  };

 private:
  friend class Search;
  uint32_t bucket(int exponent, const int32_t (&cell)[3]) const;

  const float* points_ = nullptr;
  std::vector<int> levels_;  ///< binary exponents of the radii of all points
  std::vector<uint32_t> starts_, entries_;
};

/// Merge points, and the film to which merged light paths contribute.
struct Merger {
  const MergeGrid* grid;  ///< null if there are no merge points
  LightSplatList* splats;
  Film* film;
};

}  // namespace wavecomb
