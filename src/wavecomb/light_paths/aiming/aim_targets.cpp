// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/light_paths/aiming/aim_targets.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <vector>

namespace wavecomb {
namespace {

/// Fraction of light paths that start unaimed. Unaimed paths also reach surfaces that no training
/// path has hit, and they limit the weights of aimed paths.
constexpr float kEvenShare = 0.25f;
/// Minimum number of training samples per sphere, and number of candidate split cells per axis.
constexpr uint32_t kMinSamples = 4, kSplits = 16;
/// Range of the radii of target spheres, relative to the radius of the scene.
constexpr double kMinRadius = 0x1p-12, kMaxRadius = 1;
/// Minimum likelihood gain of a split, relative to the total contribution.
constexpr double kMinSplitGain = 0.01;

using Position = std::array<float, 3>;

Position position_of(const AimSample& sample) {
  return {sample.x, sample.y, sample.z};
}

/// Bounding box, total contribution and number of samples of a set of training samples.
struct SampleBounds {
  Position lo{}, hi{};
  double contribution = 0;
  uint32_t count = 0;

  void add(const Position& l, const Position& h, double more, uint32_t n) {
    for (size_t a = 0; a < 3; ++a) {
      lo[a] = count == 0 ? l[a] : std::min(lo[a], l[a]);
      hi[a] = count == 0 ? h[a] : std::max(hi[a], h[a]);
    }
    contribution += more;
    count += n;
  }
  void add(const SampleBounds& other) {
    if (other.count > 0) add(other.lo, other.hi, other.contribution, other.count);
  }
  /// Returns the radius of the sphere around the bounding box, enlarged by 1 + 1 / sqrt(count),
  /// because few samples underestimate the extent.
  double radius(double scene) const {
    double square = 0;
    for (size_t a = 0; a < 3; ++a) square += 0.25 * std::pow(double{hi[a]} - double{lo[a]}, 2);
    const double enlargement = 1 + 1 / std::sqrt(static_cast<double>(std::max(count, 1u)));
    return std::clamp(std::sqrt(square) * enlargement, kMinRadius * scene, kMaxRadius * scene);
  }
  /// Returns the log-likelihood of the set, up to a constant: W log(W / A), with W the contribution
  /// and A = r^2.
  double likelihood(double scene) const {
    return contribution > 0 ? contribution * (std::log(contribution) - 2 * std::log(radius(scene)))
                            : 0;
  }
};

struct Split {
  double gain = 0;
  size_t axis = 0;
  float at = 0;
};

struct SampleRange {
  size_t begin, end;
  SampleBounds bounds;
  Split split;
};

/// Returns the index of the cell that contains `at`, if `box` is divided into kSplits cells along
/// `axis`.
uint32_t split_cell(const SampleBounds& box, size_t axis, float at) {
  const float wide = box.hi[axis] - box.lo[axis];
  const float share = wide > 0 ? (at - box.lo[axis]) / wide : 0;
  return std::min(static_cast<uint32_t>(share * static_cast<float>(kSplits)), kSplits - 1);
}

/// Finds the axis-aligned split of `whole` that increases the likelihood most; a gain of 0 means
/// that no split does.
Split best_split(std::span<const AimSample> aim_samples, const SampleBounds& whole, double scene) {
  Split best;
  for (size_t axis = 0; axis < 3; ++axis) {
    if (!(whole.hi[axis] > whole.lo[axis])) continue;
    std::array<SampleBounds, kSplits> cells;
    for (const AimSample& sample : aim_samples) {
      const Position p = position_of(sample);
      cells[split_cell(whole, axis, p[axis])].add(p, p, double{sample.contribution}, 1);
    }
    std::array<SampleBounds, kSplits> above;  // element i is the sum over cells i and higher
    SampleBounds sum;
    for (size_t i = kSplits; i-- > 0;) {
      sum.add(cells[i]);
      above[i] = sum;
    }
    SampleBounds below;
    for (size_t i = 1; i < kSplits; ++i) {
      below.add(cells[i - 1]);
      if (std::min(below.count, above[i].count) < kMinSamples) continue;
      const double gain =
          below.likelihood(scene) + above[i].likelihood(scene) - whole.likelihood(scene);
      if (gain > best.gain) best = {gain, axis, static_cast<float>(i)};
    }
  }
  return best;
}

SampleRange make_range(std::span<const AimSample> all, size_t begin, size_t end, double scene) {
  SampleRange range{begin, end, {}, {}};
  const auto some = all.subspan(begin, end - begin);
  for (const AimSample& sample : some)
    range.bounds.add(position_of(sample), position_of(sample), double{sample.contribution}, 1);
  range.split = best_split(some, range.bounds, scene);
  return range;
}

/// Splits the samples greedily, the split with the largest gain first, into at most LightAim::kMax
/// ranges.
std::vector<SampleRange> split_greedily(std::vector<AimSample>& all, double scene) {
  std::vector<SampleRange> ranges{make_range(all, 0, all.size(), scene)};
  const double least = kMinSplitGain * ranges[0].bounds.contribution;
  while (ranges.size() < LightAim::kMax) {
    const auto most = std::max_element(
        ranges.begin(), ranges.end(),
        [](const SampleRange& a, const SampleRange& b) { return a.split.gain < b.split.gain; });
    if (!(most->split.gain > least)) break;
    const SampleRange old = *most;
    const auto from = all.begin() + static_cast<std::ptrdiff_t>(old.begin);
    const auto to = all.begin() + static_cast<std::ptrdiff_t>(old.end);
    const auto middle = std::stable_partition(from, to, [&](const AimSample& sample) {
      return static_cast<float>(split_cell(old.bounds, old.split.axis,
                                           position_of(sample)[old.split.axis])) < old.split.at;
    });
    const auto split = static_cast<size_t>(middle - all.begin());
    *most = make_range(all, old.begin, split, scene);
    ranges.push_back(make_range(all, split, old.end, scene));
  }
  return ranges;
}

}  // namespace

LightAim aim_targets(std::span<const AimSample> aim_samples, float scene_radius) {
  std::vector<AimSample> all;
  std::copy_if(
      aim_samples.begin(), aim_samples.end(), std::back_inserter(all),
      [](const AimSample& l) { return l.contribution > 0 && std::isfinite(l.contribution); });
  LightAim aim;
  if (all.size() < kMinSamples || !(scene_radius > 0)) return aim;
  const auto scene = double{scene_radius};
  double contribution = 0;
  for (const AimSample& l : all) contribution += double{l.contribution};
  for (AimSample& l : all)
    l.contribution = static_cast<float>(double{l.contribution} / contribution);
  const std::vector<SampleRange> ranges = split_greedily(all, scene);
  contribution = 0;
  for (const SampleRange& range : ranges) contribution += range.bounds.contribution;
  aim.even = kEvenShare;
  double end = double{kEvenShare};
  for (const SampleRange& range : ranges) {
    const uint32_t k = aim.count++;
    const auto middle = [&](size_t a) { return 0.5f * (range.bounds.lo[a] + range.bounds.hi[a]); };
    aim.x[k] = middle(0);
    aim.y[k] = middle(1);
    aim.z[k] = middle(2);
    aim.radius[k] = static_cast<float>(range.bounds.radius(scene));
    aim.share[k] =
        static_cast<float>((1 - double{kEvenShare}) * range.bounds.contribution / contribution);
    end += double{aim.share[k]};
    aim.end[k] = static_cast<float>(end);
  }
  return aim;
}

}  // namespace wavecomb
