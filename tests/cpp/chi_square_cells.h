// SPDX-License-Identifier: Apache-2.0
/// Building blocks of chi_square.cpp: integrals over boxes of a chart, and boxes with equal numbers
/// of samples.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "chi_square.h"

namespace wavecomb::chi_square {

struct Box {
  std::array<double, 2> low, high;
  double extent(size_t axis) const { return high[axis] - low[axis]; }
  double middle(size_t axis) const { return 0.5 * (low[axis] + high[axis]); }
};

using Point = std::array<double, 2>;
using Points = std::vector<Point>::iterator;

/// Returns the extent of the points along an axis, as a fraction of the extent of the box.
inline double spread(const Box& box, Points first, Points last, size_t axis) {
  const auto [low, high] = std::minmax_element(
      first, last, [axis](const Point& a, const Point& b) { return a[axis] < b[axis]; });
  return ((*high)[axis] - (*low)[axis]) / box.extent(axis);
}

/// Adaptive integration of a density over boxes.
class Integral {
 public:
  Integral(const Case& c, uint32_t chart, const std::vector<Place>& pilot)
      : case_(c), chart_(chart) {
    const Chart& k = c.charts[chart];
    widest_ = {(k.x1 - k.x0) / c.boxes, (k.y1 - k.y0) / c.boxes};
    first_ = {k.x0, k.y0};
    step_ = {(k.x1 - k.x0) / k.columns, (k.y1 - k.y0) / k.rows};
    for (size_t i = 0; i < pilot.size(); i += 1 + pilot.size() / 4000)
      if (pilot[i].chart == chart) highest_ = std::max(highest_, 2 * c.density(pilot[i]));
  }

  /// Integrates the density over a box. First splits the box until its pilot samples, which show
  /// where lobes are, fill at least 40 % of its extent. Then splits boxes until the integral
  /// changes by less than `tolerance`; each split multiplies the tolerance by 0.7.
  double over(const Box& box, Points first, Points last, double tolerance, int depth = 60) const {
    if (depth > 0 && last - first > 2) {
      const double fill[2] = {spread(box, first, last, 0), spread(box, first, last, 1)};
      const size_t axis = fill[1] < fill[0];
      if (fill[axis] < 0.4) {
        const double middle = cut(box, axis).at;
        const Points border =
            std::partition(first, last, [&](const Point& p) { return p[axis] < middle; });
        Box low = box, high = box;
        low.high[axis] = high.low[axis] = middle;
        return over(low, first, border, tolerance, depth - 1) +
               over(high, border, last, tolerance, depth - 1);
      }
    }
    return refine(box, gauss(box), first, last, tolerance, 24);
  }

 private:
  /// Position of a split: the middle of the box, or the nearest boundary of a column or row if it
  /// lies inside the box.
  struct Cut {
    double at;
    bool is_border;
  };
  Cut cut(const Box& box, size_t axis) const {
    const double middle = box.middle(axis),
                 border =
                     first_[axis] + std::round((middle - first_[axis]) / step_[axis]) * step_[axis];
    const double margin = 1e-9 * step_[axis];
    if (border > box.low[axis] + margin && border < box.high[axis] - margin) return {border, true};
    return {middle, false};
  }

  struct Estimate {
    double sum;
    std::array<double, 2> bend;  ///< sum of absolute second differences along each axis
  };

  /// Integrates a box by the product of two 3-point Gauss rules.
  Estimate gauss(const Box& b) const {
    constexpr double kNode = 0.7745966692414834;
    constexpr double kX[3] = {0.5 - 0.5 * kNode, 0.5, 0.5 + 0.5 * kNode};
    constexpr double kW[3] = {5.0 / 18, 8.0 / 18, 5.0 / 18};
    double f[3][3], sum = 0;
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 3; ++j) {
        f[i][j] =
            case_.density({chart_, b.low[0] + b.extent(0) * kX[i], b.low[1] + b.extent(1) * kX[j]});
        sum += kW[i] * kW[j] * f[i][j];
      }
    Estimate e{sum * b.extent(0) * b.extent(1), {0, 0}};
    for (int i = 0; i < 3; ++i) {
      e.bend[0] += std::abs(f[0][i] - 2 * f[1][i] + f[2][i]);
      e.bend[1] += std::abs(f[i][0] - 2 * f[i][1] + f[i][2]);
    }
    return e;
  }

  /// Returns whether `sum`, the integral over both halves of a box, is accurate enough. `whole` is
  /// the integral by a single rule over the box. Since these rules can miss a narrow lobe, a third
  /// rule and the pilot samples must agree with them. A box is also accepted if it is so small that
  /// even the highest density in the chart would contribute little.
  bool is_symbol(const Box& box, double whole, double sum, Points first, Points last,
                 double tolerance) const {
    const double area = box.extent(0) * box.extent(1), change = std::abs(sum - whole);
    if (highest_ * area < tolerance) return true;
    if (change > tolerance || (case_.is_smooth && change > 0.1 * sum)) return false;
    constexpr double kX[2] = {0.21132486540518713, 0.7886751345948129};
    double third = 0;
    for (const double x : kX)
      for (const double y : kX)
        third +=
            0.25 * area *
            case_.density({chart_, box.low[0] + box.extent(0) * x, box.low[1] + box.extent(1) * y});
    if (std::abs(third - sum) > (case_.is_smooth ? 0.2 * sum : 3 * tolerance)) return false;
    return std::none_of(first, last, [&](const Point& p) {
      return area * case_.density({chart_, p[0], p[1]}) > 3 * sum;
    });
  }

  double refine(const Box& box, const Estimate& whole, Points first, Points last, double tolerance,
                int depth) const {
    const Cut cuts[2] = {cut(box, 0), cut(box, 1)};
    const double wide[2] = {box.extent(0) / widest_[0], box.extent(1) / widest_[1]};
    const bool is_wide = wide[0] > 1 || wide[1] > 1;
    const bool jumps = cuts[0].is_border || cuts[1].is_border;
    const size_t axis = jumps     ? !cuts[0].is_border
                        : is_wide ? (wide[1] > wide[0])
                                  : (whole.bend[1] > whole.bend[0]);
    const double middle = cuts[axis].at;
    Box low = box, high = box;
    low.high[axis] = high.low[axis] = middle;
    const Estimate a = gauss(low), b = gauss(high);
    const double sum = a.sum + b.sum;
    if (depth == 0 ||
        (!jumps && !is_wide && is_symbol(box, whole.sum, sum, first, last, tolerance)))
      return sum;
    const Points border =
        std::partition(first, last, [&](const Point& p) { return p[axis] < middle; });
    return refine(low, a, first, border, 0.7 * tolerance, depth - 1) +
           refine(high, b, border, last, 0.7 * tolerance, depth - 1);
  }

  const Case& case_;
  uint32_t chart_;
  std::array<double, 2> widest_;
  std::array<double, 2> first_, step_;
  double highest_ = 0;
};

/// Boxes with about equal numbers of pilot samples: one k-d tree per chart, split at medians.
class Leaves {
 public:
  Leaves(const Case& c, const std::vector<Place>& pilot, size_t points_of_leaf)
      : points_of_leaf_(points_of_leaf) {
    std::vector<std::vector<Point>>& points = points_;
    points.resize(c.charts.size());
    for (const Place& p : pilot) points[p.chart].push_back({p.x, p.y});
    for (uint32_t i = 0; i < c.charts.size(); ++i) {
      const Chart& k = c.charts[i];
      chart_ = i;
      roots_.push_back(split({{k.x0, k.y0}, {k.x1, k.y1}}, points[i].begin(), points[i].end()));
    }
  }

  struct Leaf {
    uint32_t chart;
    Box box;
    Points first, last;  ///< pilot samples inside
  };
  const std::vector<Leaf>& all() const { return leaves_; }

  size_t find(const Place& p) const {
    int node = roots_[p.chart];
    const double at[2] = {p.x, p.y};
    while (node >= 0) {
      const Node& n = nodes_[static_cast<size_t>(node)];
      node = at[n.axis] < n.at ? n.low : n.high;
    }
    return static_cast<size_t>(-node - 1);
  }

 private:
  struct Node {
    size_t axis;
    double at;
    int low, high;  ///< index of a k-d tree node, or -1 - index of a leaf
  };

  int split(const Box& box, Points first, Points last, size_t next = 0) {
    const auto count = static_cast<size_t>(last - first);
    double at = 0;
    size_t axis = 0;
    bool can_split = false;
    if (count >= 2 * points_of_leaf_) {
      const double x = spread(box, first, last, 0), y = spread(box, first, last, 1);
      // Alternate between the axes, unless the points differ along one axis only.
      axis = x < 0.3 * y ? 1 : y < 0.3 * x ? 0 : next;
      for (int attempt = 0; attempt < 2 && !can_split; ++attempt) {
        if (attempt > 0) axis = 1 - axis;
        const Points half = first + static_cast<std::ptrdiff_t>(count / 2);
        std::nth_element(first, half, last,
                         [axis](const Point& a, const Point& b) { return a[axis] < b[axis]; });
        at = (*half)[axis];
        can_split = at > box.low[axis] && at < box.high[axis];
      }
    }
    if (!can_split) {
      leaves_.push_back({chart_, box, first, last});
      return -static_cast<int>(leaves_.size());
    }
    const Points border = std::partition(first, last, [&](const Point& p) { return p[axis] < at; });
    Box low = box, high = box;
    low.high[axis] = high.low[axis] = at;
    const auto node = nodes_.size();
    nodes_.push_back({axis, at, 0, 0});
    const int below = split(low, first, border, 1 - axis);
    const int above = split(high, border, last, 1 - axis);
    nodes_[node].low = below;
    nodes_[node].high = above;
    return static_cast<int>(node);
  }

  size_t points_of_leaf_;
  uint32_t chart_ = 0;
  std::vector<std::vector<Point>> points_;  ///< per chart
  std::vector<Leaf> leaves_;
  std::vector<Node> nodes_;
  std::vector<int> roots_;
};

}  // namespace wavecomb::chi_square
