// SPDX-License-Identifier: Apache-2.0
/// Traversal of a grid along a ray, cell by cell.
#pragma once

#include "wavecomb/medium/volume/grid_lookup.h"

namespace wavecomb {

/// Traversal of one grid by a packet, in which each lane follows its own ray (Amanatides and Woo,
/// "A Fast Voxel Traversal Algorithm", 1987). All distances along the ray are in world space.
template <typename F>
class GridTraversal {
  using U = UInt<F>;

 public:
  /// Creates a traversal in which no lane is active.
  explicit GridTraversal(const TransformedGrid& transformed)
      : transformed_(transformed),
        grid_(transformed.grid),
        o_(F(0.f)),
        d_(F(0.f)),
        x_(0.f),
        end_(0.f),
        on_(false) {
    for (int k = 0; k < 3; ++k) {
      inverse_[k] = cell_[k] = next_[k] = F(0.f);
      forward_[k] = moves_[k] = Mask<F>(false);
    }
  }
  GridTraversal(const TransformedGrid& transformed, const Vec3<F>& o, const Vec3<F>& d,
                const F& most, const Mask<F>& active)
      : GridTraversal(transformed) {
    start(o, d, most, active);
  }

  /// Starts the rays of `lanes`. The traversal covers the part of o + x d, 0 < x < `most`, inside
  /// the grid's table.
  void start(const Vec3<F>& o, const Vec3<F>& d, const F& most, const Mask<F>& lanes) {
    o_ = select<F>(lanes, bricks_point<F>(transformed_.to_bricks, o), o_);
    d_ = select<F>(lanes, bricks_vector<F>(transformed_.to_bricks, d), d_);
    const F* const from[3] = {&o_.x, &o_.y, &o_.z};
    const F* const along[3] = {&d_.x, &d_.y, &d_.z};
    F enter(0.f), end = most;
    Mask<F> hits_box = lanes;
    for (int k = 0; k < 3; ++k) {
      const auto size = static_cast<float>(grid_.size[k]);
      moves_[k] = *along[k] != F(0.f);
      forward_[k] = *along[k] > F(0.f);
      inverse_[k] = F(1.f) / select(moves_[k], *along[k], F(1.f));
      const F a = (F(0.f) - *from[k]) * inverse_[k], b = (F(size) - *from[k]) * inverse_[k];
      enter = select(moves_[k], max(enter, min(a, b)), enter);
      end = select(moves_[k], min(end, max(a, b)), end);
      hits_box = hits_box & (moves_[k] | ((*from[k] >= F(0.f)) & (*from[k] < F(size))));
    }
    hits_box = hits_box & (enter < end);
    on_ = (on_ & not_(lanes)) | hits_box;
    x_ = select(lanes, enter, x_);
    end_ = select(lanes, end, end_);
    for (int k = 0; k < 3; ++k) {
      const F at = select(hits_box, fma(*along[k], enter, *from[k]), F(0.f));
      const F first = clamp(floor(at), F(0.f), F(static_cast<float>(grid_.size[k]) - 1.f));
      cell_[k] = select(lanes, first, cell_[k]);
      next_[k] = select(lanes, crossing(k), next_[k]);
    }
  }

  /// Returns the lanes whose rays have not reached their end.
  const Mask<F>& on() const { return on_; }
  /// Returns the current distance. leave() returns the distance at which a lane leaves its cell or
  /// ends.
  const F& x() const { return x_; }
  F leave() const { return max(x_, min(min(next_[0], next_[1]), min(next_[2], end_))); }
  /// Returns the largest value of the grid in the current cell.
  F most() const {
    if (!grid_.most) return F(1.f);
    const auto at = [&](int k) { return U(to_int<F>(cell_[k])); };
    return gather<F>(grid_.most, at(0) + grid_.size[0] * (at(1) + grid_.size[1] * at(2)), on_);
  }
  /// Returns the point at distance `x` in the grid's space.
  Vec3<F> at(const F& x) const { return fma(d_, x, o_); }

  /// Moves `lanes` to distance x within their cell.
  void move_to(const F& x, const Mask<F>& lanes) { x_ = select(lanes, x, x_); }
  void stop(const Mask<F>& lanes) { on_ = on_ & not_(lanes); }
  /// Advances `lanes` to the next cell.
  void next_cell(Mask<F> lanes) {
    const F leaves = leave();
    x_ = select(lanes, leaves, x_);
    Mask<F> pending = lanes & on_;
    on_ = on_ & (not_(lanes) | (leaves < end_));
    for (int k = 0; k < 3; ++k) {
      const Mask<F> crosses = pending & (next_[k] <= leaves);
      pending = pending & not_(crosses);
      cell_[k] = select(crosses, F(cell_[k] + select(forward_[k], F(1.f), F(-1.f))), cell_[k]);
      const auto last = static_cast<float>(grid_.size[k]) - 1.f;
      on_ = on_ & not_(crosses & ((cell_[k] < F(0.f)) | (cell_[k] > F(last))));
      next_[k] = select(crosses, crossing(k), next_[k]);
    }
  }

 private:
  /// Returns the distance at which the ray leaves its cell along axis k.
  F crossing(int k) const {
    const F* const from[3] = {&o_.x, &o_.y, &o_.z};
    const F face = cell_[k] + select(forward_[k], F(1.f), F(0.f));
    return select(moves_[k], F((face - *from[k]) * inverse_[k]), F(kInfinity));
  }

  const TransformedGrid& transformed_;
  const GridView& grid_;
  Vec3<F> o_, d_;
  F inverse_[3], cell_[3], next_[3];
  Mask<F> forward_[3], moves_[3];
  F x_, end_;
  Mask<F> on_;
};

}  // namespace wavecomb
