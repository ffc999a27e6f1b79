// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/light/emission/aim_targets.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <vector>

namespace wavecomb {
namespace {

/// Fraction of light paths that start unaimed. They reach surfaces that no training path has hit
/// and keep the weights of aimed paths bounded.
constexpr float kEvenShare = 0.25f;
/// Minimum number of training samples per sphere, and number of candidate split cells per axis.
constexpr uint32_t kLeastLessons = 4, kCuts = 16;
/// Range of sphere radii, relative to the radius of the scene.
constexpr double kLeastRadius = 0x1p-12, kMostRadius = 1;
/// Minimum likelihood gain of a split, relative to the total contribution.
constexpr double kLeastCutGain = 0.01;

using Place = std::array<float, 3>;

Place place_of(const AimLesson& lesson) {
  return {lesson.x, lesson.y, lesson.z};
}

/// Bounding box, total contribution and number of a set of training samples.
struct Heap {
  Place lo{}, hi{};
  double worth = 0;
  uint32_t count = 0;

  void add(const Place& l, const Place& h, double more, uint32_t n) {
    for (size_t a = 0; a < 3; ++a) {
      lo[a] = count == 0 ? l[a] : std::min(lo[a], l[a]);
      hi[a] = count == 0 ? h[a] : std::max(hi[a], h[a]);
    }
    worth += more;
    count += n;
  }
  void add(const Heap& other) {
    if (other.count > 0) add(other.lo, other.hi, other.worth, other.count);
  }
  /// Radius of the sphere around the box, enlarged by 1 + 1 / sqrt(count) because few samples
  /// underestimate the extent.
  double radius(double scene) const {
    double square = 0;
    for (size_t a = 0; a < 3; ++a) square += 0.25 * std::pow(double{hi[a]} - double{lo[a]}, 2);
    const double room = 1 + 1 / std::sqrt(static_cast<double>(std::max(count, 1u)));
    return std::clamp(std::sqrt(square) * room, kLeastRadius * scene, kMostRadius * scene);
  }
  /// Log-likelihood of the set, up to a constant: W log(W / A) with A = r^2.
  double likelihood(double scene) const {
    return worth > 0 ? worth * (std::log(worth) - 2 * std::log(radius(scene))) : 0;
  }
};

struct Cut {
  double gain = 0;
  size_t axis = 0;
  float at = 0;
};

struct Piece {
  size_t begin, end;
  Heap heap;
  Cut cut;
};

/// Returns the index of the split cell, of kCuts along `axis` of `box`, that contains `at`.
uint32_t cut_cell(const Heap& box, size_t axis, float at) {
  const float wide = box.hi[axis] - box.lo[axis];
  const float share = wide > 0 ? (at - box.lo[axis]) / wide : 0;
  return std::min(static_cast<uint32_t>(share * static_cast<float>(kCuts)), kCuts - 1);
}

/// Finds the axis-aligned split of `whole` that gains most likelihood; a gain of 0 means that there
/// is none.
Cut best_cut(std::span<const AimLesson> lessons, const Heap& whole, double scene) {
  Cut best;
  for (size_t axis = 0; axis < 3; ++axis) {
    if (!(whole.hi[axis] > whole.lo[axis])) continue;
    std::array<Heap, kCuts> cells;
    for (const AimLesson& lesson : lessons) {
      const Place p = place_of(lesson);
      cells[cut_cell(whole, axis, p[axis])].add(p, p, double{lesson.worth}, 1);
    }
    std::array<Heap, kCuts> above;  // sums of cells i and higher
    Heap sum;
    for (size_t i = kCuts; i-- > 0;) {
      sum.add(cells[i]);
      above[i] = sum;
    }
    Heap below;
    for (size_t i = 1; i < kCuts; ++i) {
      below.add(cells[i - 1]);
      if (std::min(below.count, above[i].count) < kLeastLessons) continue;
      const double gain =
          below.likelihood(scene) + above[i].likelihood(scene) - whole.likelihood(scene);
      if (gain > best.gain) best = {gain, axis, static_cast<float>(i)};
    }
  }
  return best;
}

Piece make_piece(std::span<const AimLesson> all, size_t begin, size_t end, double scene) {
  Piece piece{begin, end, {}, {}};
  const auto some = all.subspan(begin, end - begin);
  for (const AimLesson& lesson : some)
    piece.heap.add(place_of(lesson), place_of(lesson), double{lesson.worth}, 1);
  piece.cut = best_cut(some, piece.heap, scene);
  return piece;
}

/// Splits the samples greedily, the largest gain first, into at most LightAim::kMost pieces.
std::vector<Piece> cut_up(std::vector<AimLesson>& all, double scene) {
  std::vector<Piece> pieces{make_piece(all, 0, all.size(), scene)};
  const double least = kLeastCutGain * pieces[0].heap.worth;
  while (pieces.size() < LightAim::kMost) {
    const auto most =
        std::max_element(pieces.begin(), pieces.end(),
                         [](const Piece& a, const Piece& b) { return a.cut.gain < b.cut.gain; });
    if (!(most->cut.gain > least)) break;
    const Piece old = *most;
    const auto from = all.begin() + static_cast<std::ptrdiff_t>(old.begin);
    const auto to = all.begin() + static_cast<std::ptrdiff_t>(old.end);
    const auto middle = std::stable_partition(from, to, [&](const AimLesson& lesson) {
      return static_cast<float>(cut_cell(old.heap, old.cut.axis, place_of(lesson)[old.cut.axis])) <
             old.cut.at;
    });
    const auto cut = static_cast<size_t>(middle - all.begin());
    *most = make_piece(all, old.begin, cut, scene);
    pieces.push_back(make_piece(all, cut, old.end, scene));
  }
  return pieces;
}

}  // namespace

LightAim aim_targets(std::span<const AimLesson> lessons, float scene_radius) {
  std::vector<AimLesson> all;
  std::copy_if(lessons.begin(), lessons.end(), std::back_inserter(all),
               [](const AimLesson& l) { return l.worth > 0 && std::isfinite(l.worth); });
  LightAim aim;
  if (all.size() < kLeastLessons || !(scene_radius > 0)) return aim;
  const auto scene = double{scene_radius};
  double worth = 0;
  for (const AimLesson& l : all) worth += double{l.worth};
  for (AimLesson& l : all) l.worth = static_cast<float>(double{l.worth} / worth);
  const std::vector<Piece> pieces = cut_up(all, scene);
  worth = 0;
  for (const Piece& piece : pieces) worth += piece.heap.worth;
  aim.even = kEvenShare;
  double end = double{kEvenShare};
  for (const Piece& piece : pieces) {
    const uint32_t k = aim.count++;
    const auto middle = [&](size_t a) { return 0.5f * (piece.heap.lo[a] + piece.heap.hi[a]); };
    aim.x[k] = middle(0);
    aim.y[k] = middle(1);
    aim.z[k] = middle(2);
    aim.radius[k] = static_cast<float>(piece.heap.radius(scene));
    aim.share[k] = static_cast<float>((1 - double{kEvenShare}) * piece.heap.worth / worth);
    end += double{aim.share[k]};
    aim.end[k] = static_cast<float>(end);
  }
  return aim;
}

}  // namespace wavecomb
