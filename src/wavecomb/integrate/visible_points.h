// SPDX-License-Identifier: Apache-2.0
/// The points that the camera sees in mirrors and through glass (visible_point.h), by place, for
/// paths from lights that end near them.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "wavecomb/film/film.h"
#include "wavecomb/integrate/visible_point.h"

namespace wavecomb {

static_assert(kVisibleWords == Film::kVisibleWords);

/// The points of a film by place: each is in the cells, of a size that goes by its radius, that the
/// sphere around it meets.
///
/// Contract: build() while nobody looks.
class VisibleGrid {
 public:
  /// `points`: rows by pixel, which stay where they are.
  void build(std::span<const float> points);
  const float* points() const { return points_; }

  /// Goes through the points that a place lies within the radius of.
  class Search {
   public:
    Search() = default;
    Search(const VisibleGrid& grid, float x, float y, float z) : grid_(&grid), at_{x, y, z} {}
    /// The next one's pixel; false: there is none any more.
    bool next(uint32_t& pixel);

   private:
    const VisibleGrid* grid_ = nullptr;
    float at_[3] = {};
    size_t level_ = 0;
    uint32_t begin_ = 0, end_ = 0;
  };

 private:
  friend class Search;
  uint32_t bucket(int exponent, const int32_t (&cell)[3]) const;

  const float* points_ = nullptr;
  std::vector<int> levels_;  ///< exponents of radii that there are
  std::vector<uint32_t> starts_, entries_;
};

/// Where vertices of paths from lights are merged with points.
struct Merger {
  const VisibleGrid* grid;  ///< null: there are none
  SplatList* splats;
  Film* film;
};

}  // namespace wavecomb
