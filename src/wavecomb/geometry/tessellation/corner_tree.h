// SPDX-License-Identifier: Apache-2.0
/// Spatial index of the corners of a polygon, for clip_ears.
#pragma once

#include <algorithm>
#include <cstdint>
#include <numeric>
#include <span>
#include <vector>

namespace wavecomb {

/// Corner of a polygon in the plane.
struct Corner {
  double x, y;
  bool operator==(const Corner&) const = default;
};

/// Returns twice the signed area of triangle a, b, c; positive if counter-clockwise.
inline double turn_of(const Corner& a, const Corner& b, const Corner& c) {
  return (b.x - a.x) * (c.y - a.y) - (b.y - a.y) * (c.x - a.x);
}

/// k-d tree of positions in the plane from which corners are removed one by one. Corners with equal
/// coordinates share a position.
class CornerTree {
 public:
  static constexpr uint32_t kNone = 0xffffffffu;

  explicit CornerTree(std::span<const Corner> corners) : position_of_(corners.size()) {
    std::vector<uint32_t> order(corners.size());
    std::iota(order.begin(), order.end(), 0u);
    std::sort(order.begin(), order.end(), [&](uint32_t a, uint32_t b) {
      const Corner &p = corners[a], &q = corners[b];
      return p.x != q.x ? p.x < q.x : p.y != q.y ? p.y < q.y : a < b;
    });
    std::vector<Corner> sorted;
    std::vector<uint32_t> counts;
    for (const uint32_t i : order) {
      if (sorted.empty() || !(sorted.back() == corners[i])) {
        sorted.push_back(corners[i]);
        counts.push_back(0);
      }
      ++counts.back();
      position_of_[i] = static_cast<uint32_t>(sorted.size() - 1);
    }
    std::vector<uint32_t> positions(sorted.size());
    std::iota(positions.begin(), positions.end(), 0u);
    build(sorted, positions, 0, static_cast<uint32_t>(positions.size()), kNone);
    std::vector<uint32_t> rank(positions.size());
    leaf_of_.resize(positions.size());
    for (uint32_t i = 0; i < positions.size(); ++i) {
      rank[positions[i]] = i;
      positions_.push_back(sorted[positions[i]]);
      counts_.push_back(counts[positions[i]]);
    }
    for (uint32_t n = 0; n < nodes_.size(); ++n)
      if (nodes_[n].child == kNone)
        std::fill(leaf_of_.begin() + nodes_[n].begin, leaf_of_.begin() + nodes_[n].end, n);
    for (uint32_t& position : position_of_) position = rank[position];
  }

  /// Returns the number of different corner positions.
  size_t position_count() const { return positions_.size(); }
  /// Returns the index of a corner's position.
  uint32_t position_of(uint32_t corner) const { return position_of_[corner]; }

  /// Removes a corner. Returns whether the removed corner was the last remaining corner at its
  /// position.
  bool remove(uint32_t corner) {
    const uint32_t position = position_of_[corner];
    if (--counts_[position] > 0) return false;
    for (uint32_t n = leaf_of_[position]; n != kNone; n = nodes_[n].parent) --nodes_[n].alive;
    return true;
  }

  /// Finds a position inside or on the counter-clockwise triangle a, b, c that still has corners
  /// and is not a vertex of the triangle. Returns kNone if no such position exists. If several
  /// positions qualify, returns a pseudo-random one. A random position is unlikely to be removed
  /// soon; this saves searches, since each removal of a blocking position requires another search.
  /// Adds the number of visited nodes to `steps`.
  uint32_t find(const Corner& a, const Corner& b, const Corner& c, uint64_t& steps) {
    const double lo_x = std::min({a.x, b.x, c.x}), hi_x = std::max({a.x, b.x, c.x});
    const double lo_y = std::min({a.y, b.y, c.y}), hi_y = std::max({a.y, b.y, c.y});
    const Edge edges[3] = {{a, b}, {b, c}, {c, a}};
    uint32_t stack[64], depth = 0;
    stack[depth++] = 0;
    while (depth > 0) {
      const Node& node = nodes_[stack[--depth]];
      ++steps;
      if (node.alive == 0 || node.lo.x > hi_x || node.hi.x < lo_x || node.lo.y > hi_y ||
          node.hi.y < lo_y)
        continue;
      if (edges[0].off(node) || edges[1].off(node) || edges[2].off(node)) continue;
      random_ = random_ * 747796405u + 2891336453u;
      const uint32_t chance = random_ >> 16;
      if (node.child != kNone) {
        stack[depth++] = node.child + (chance & 1u);
        stack[depth++] = node.child + (~chance & 1u);
        continue;
      }
      const uint32_t size = node.end - node.begin;
      for (uint32_t k = 0, i = chance % size; k < size; ++k, i = i + 1 == size ? 0 : i + 1) {
        const Corner& p = positions_[node.begin + i];
        if (counts_[node.begin + i] > 0 && turn_of(a, b, p) >= 0 && turn_of(b, c, p) >= 0 &&
            turn_of(c, a, p) >= 0 && !(p == a) && !(p == b) && !(p == c))
          return node.begin + i;
      }
    }
    return kNone;
  }

 private:
  static constexpr uint32_t kLeaf = 4;

  struct Node {
    Corner lo, hi;
    uint32_t begin, end;     ///< range of positions
    uint32_t alive;          ///< number of positions with remaining corners
    uint32_t parent, child;  ///< index of the first of two children; kNone for a leaf
  };
  struct Edge {
    Corner from, to;
    /// Returns whether the node's bounding box lies entirely to the right of the edge.
    /// Floating-point rounding is monotonic, so the result agrees with tests of the positions
    /// inside the box.
    bool off(const Node& n) const {
      return turn_of(from, to, {to.y > from.y ? n.lo.x : n.hi.x, to.x > from.x ? n.hi.y : n.lo.y}) <
             0;
    }
  };

  uint32_t build(std::span<const Corner> at, std::vector<uint32_t>& positions, uint32_t begin,
                 uint32_t end, uint32_t parent) {
    const auto index = static_cast<uint32_t>(nodes_.size());
    nodes_.emplace_back();
    fill(index, at, positions, begin, end, parent);
    return index;
  }

  void fill(uint32_t index, std::span<const Corner> at, std::vector<uint32_t>& positions,
            uint32_t begin, uint32_t end, uint32_t parent) {
    Node node{at[positions[begin]], at[positions[begin]], begin, end, end - begin, parent, kNone};
    for (uint32_t i = begin; i < end; ++i) {
      const Corner& p = at[positions[i]];
      node.lo = {std::min(node.lo.x, p.x), std::min(node.lo.y, p.y)};
      node.hi = {std::max(node.hi.x, p.x), std::max(node.hi.y, p.y)};
    }
    if (end - begin > kLeaf) {
      const bool wide = node.hi.x - node.lo.x >= node.hi.y - node.lo.y;
      const uint32_t middle = begin + (end - begin) / 2;
      std::nth_element(
          positions.begin() + begin, positions.begin() + middle, positions.begin() + end,
          [&](uint32_t a, uint32_t b) { return wide ? at[a].x < at[b].x : at[a].y < at[b].y; });
      node.child = static_cast<uint32_t>(nodes_.size());
      nodes_.resize(nodes_.size() + 2);
      fill(node.child, at, positions, begin, middle, index);
      fill(node.child + 1, at, positions, middle, end, index);
    }
    nodes_[index] = node;
  }

  std::vector<Node> nodes_;
  std::vector<Corner> positions_;  ///< in leaf order
  std::vector<uint32_t> counts_;   ///< number of remaining corners at each position
  std::vector<uint32_t> leaf_of_, position_of_;
  uint32_t random_ = 1;
};

}  // namespace wavecomb
