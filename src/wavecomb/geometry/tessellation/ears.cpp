// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/geometry/tessellation/ears.h"

#include <bit>
#include <cmath>

#include "wavecomb/geometry/tessellation/corner_tree.h"

namespace wavecomb {
namespace {

constexpr uint32_t kNone = CornerTree::kNone;

/// Set of integers below n with a fast search for the next element. It is a hierarchy of bit sets,
/// where each bit of an upper level states whether a 64-bit word of the level below is non-zero.
class NumberSet {
 public:
  explicit NumberSet(size_t n) {
    do {
      levels_.emplace_back((n + 63) / 64, 0);
      n = levels_.back().size();
    } while (n > 1);
  }
  void add(uint32_t i) {
    for (std::vector<uint64_t>& level : levels_) {
      level[i / 64] |= uint64_t{1} << (i % 64);
      i /= 64;
    }
  }
  void remove(uint32_t i) {
    for (std::vector<uint64_t>& level : levels_) {
      level[i / 64] &= ~(uint64_t{1} << (i % 64));
      if (level[i / 64] != 0) return;
      i /= 64;
    }
  }
  /// Returns the smallest element >= i, or kNone.
  uint32_t next(uint32_t i) const {
    size_t up = 0;
    for (;; ++up, i = i / 64 + 1) {
      if (up == levels_.size() || i / 64 >= levels_[up].size()) return kNone;
      if (const uint64_t rest = levels_[up][i / 64] >> (i % 64); rest != 0) {
        i += static_cast<uint32_t>(std::countr_zero(rest));
        break;
      }
    }
    while (up-- > 0) i = i * 64 + static_cast<uint32_t>(std::countr_zero(levels_[up][i]));
    return i;
  }

 private:
  std::vector<std::vector<uint64_t>> levels_;
};

/// Ear clipping algorithm for one polygon.
class Clipper {
 public:
  Clipper(std::span<const Corner> corners, uint64_t max_steps)
      : corners_(corners),
        max_steps_(max_steps),
        left_(corners.size()),
        open_(corners.size()),
        next_(corners.size()),
        previous_(corners.size()),
        blocked_(corners.size()),
        tree_(corners),
        first_(tree_.position_count(), kNone) {
    const auto n = static_cast<uint32_t>(corners.size());
    for (uint32_t i = 0; i < n; ++i) {
      next_[i] = i + 1 == n ? 0 : i + 1;
      previous_[i] = i == 0 ? n - 1 : i - 1;
      open_.add(i);
    }
  }

  PolygonTriangulation run() {
    PolygonTriangulation triangulation;
    triangulation.corners.reserve(3 * (left_ - 2));
    const auto put = [&](uint32_t a, uint32_t b, uint32_t c) {
      for (const uint32_t corner : {a, b, c}) triangulation.corners.push_back(corner);
    };
    uint32_t start_corner = 0;
    while (left_ > 3) {
      uint32_t ear = start_corner;
      if (steps_ < max_steps_)
        ear = next_ear(start_corner);
      else
        ++triangulation.untested;
      put(previous_[ear], ear, next_[ear]);
      start_corner = next_[ear];
      cut(ear);
    }
    uint32_t rest[3] = {start_corner, next_[start_corner], previous_[start_corner]};
    std::sort(rest, rest + 3);
    put(rest[0], rest[1], rest[2]);
    return triangulation;
  }

 private:
  /// Entry of a linked list of corners that are blocked by the same position: they cannot be cut
  /// until all corners at this position have been removed.
  struct Blocked {
    uint32_t position = kNone, next = kNone, previous = kNone;
  };

  /// Returns the first ear at or after corner `start_corner`, or `start_corner` if no ear is left.
  uint32_t next_ear(uint32_t start_corner) {
    for (uint32_t at = start_corner;;) {
      uint32_t found = open_.next(at);
      if (found == kNone) found = open_.next(0);
      if (found == kNone) return start_corner;
      if (is_ear(found)) return found;
      open_.remove(found);
      at = found;
    }
  }

  bool is_ear(uint32_t i) {
    ++steps_;
    const Corner &a = corners_[previous_[i]], &b = corners_[i], &c = corners_[next_[i]];
    if (turn_of(a, b, c) <= 0) return false;
    const uint32_t position = tree_.find(a, b, c, steps_);
    if (position == kNone) return true;
    blocked_[i] = {position, first_[position], kNone};
    if (first_[position] != kNone) blocked_[first_[position]].previous = i;
    first_[position] = i;
    return false;
  }

  void reopen(uint32_t i) {
    Blocked& b = blocked_[i];
    if (b.position != kNone) {
      (b.previous == kNone ? first_[b.position] : blocked_[b.previous].next) = b.next;
      if (b.next != kNone) blocked_[b.next].previous = b.previous;
      b = {};
    }
    open_.add(i);
  }

  void cut(uint32_t i) {
    reopen(i);
    open_.remove(i);
    const uint32_t a = previous_[i], c = next_[i];
    next_[a] = c;
    previous_[c] = a;
    --left_;
    if (tree_.remove(i))
      for (const uint32_t position = tree_.position_of(i); first_[position] != kNone;)
        reopen(first_[position]);
    reopen(a);
    reopen(c);
  }

  std::span<const Corner> corners_;
  uint64_t max_steps_, steps_ = 0;
  size_t left_;
  NumberSet open_;  ///< corners that may be ears
  std::vector<uint32_t> next_, previous_;
  std::vector<Blocked> blocked_;
  CornerTree tree_;
  std::vector<uint32_t> first_;  ///< first corner of the list of blocked corners, for each position
};

}  // namespace

PolygonTriangulation clip_ears(std::span<const double> flat, uint64_t max_steps) {
  std::vector<Corner> corners(flat.size() / 2);
  for (size_t i = 0; i < corners.size(); ++i) corners[i] = {flat[2 * i], flat[2 * i + 1]};
  if (corners.size() < 3) return {};
  for (const Corner& c : corners)
    if (!std::isfinite(c.x) || !std::isfinite(c.y)) {
      PolygonTriangulation fan;
      for (size_t i = 1; i + 1 < corners.size(); ++i)
        for (const size_t corner : {size_t{0}, i, i + 1})
          fan.corners.push_back(static_cast<int64_t>(corner));
      return fan;
    }
  return Clipper(corners, max_steps).run();
}

}  // namespace wavecomb
