// SPDX-License-Identifier: Apache-2.0
/// Light splats, which are contributions of light paths to arbitrary pixels of the image.
///
/// The sums of light splats are integers, so that they do not depend on the order of additions and
/// any wave can add splats to any pixel at any time. Each wave collects its light splats in a
/// LightSplatList. Between wave stages, the wave's worker adds the list to the film's
/// LightSplatLayer.
#pragma once

#include <algorithm>
#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "wavecomb/core/encoding/fixed_point.h"

namespace wavecomb {

/// Buffer of light splats with a fixed capacity.
///
/// Contract: the list belongs to a single worker. Only the constructor allocates memory.
class LightSplatList {
 public:
  struct LightSplat {
    uint32_t pixel;  ///< Film::index
    float r, g, b;
    bool in_half =
        false;  ///< result of `LightSplatLayer::is_in_half` for the sample index of the light path
  };

  LightSplatList() = default;
  explicit LightSplatList(size_t capacity) { splats_.reserve(capacity); }

  /// Adds a light splat. Returns false and does not add the splat if the list is full.
  [[nodiscard]] bool add(const LightSplat& splat) {
    if (splats_.size() == splats_.capacity()) return false;
    splats_.push_back(splat);
    return true;
  }
  void clear() { splats_.clear(); }
  size_t bytes() const { return splats_.capacity() * sizeof(LightSplat); }
  std::span<const LightSplat> splats() const { return splats_; }

 private:
  std::vector<LightSplat> splats_;
};

/// Fixed-point sums of light splats.
///
/// A single 64-bit sum cannot represent the range of values of light splats. Values of at least
/// `kMinCoarse` units are therefore added to a second sum, whose unit is larger by the factor
/// 2^kCoarseExponent.
///
/// Contract: several threads may call add() at the same time. Other members may be called only
/// while no thread calls add().
class LightSplatSums {
 public:
  /// Sums of red, green and blue in the smaller unit, followed by the sums of red, green and blue
  /// in the larger unit.
  using Sum = std::array<int64_t, 6>;
  /// `kCoarseExponent` is the base-2 logarithm of the ratio between the larger and the smaller
  /// unit. `kMinCoarse` is the smallest value that is added to the second sum, in the smaller unit.
  static constexpr int kCoarseExponent = 20;
  static constexpr double kMinCoarse = 0x1p40;

  LightSplatSums() = default;
  LightSplatSums(size_t sum_count, FixedPoint unit)
      : unit_(unit), scale_(std::ldexp(1.0, -unit.exponent)), sums_(sum_count) {}

  bool empty() const { return sums_.empty(); }
  size_t bytes() const { return sums_.size() * sizeof(Sum); }
  /// Adds a colour atomically to the sum with the index `sum_index`.
  void add(size_t sum_index, float r, float g, float b) {
    const FixedPoint coarse{unit_.exponent + kCoarseExponent};
    Sum& sum = sums_[sum_index];
    const float rgb[3] = {r, g, b};
    for (size_t c = 0; c < 3; ++c) {
      const double units = double{rgb[c]} * scale_;
      if (std::abs(units) < kMinCoarse)
        plus(sum[c], static_cast<int64_t>(std::nearbyint(units)));
      else
        plus(sum[c + 3], coarse.from(rgb[c]));
    }
  }
  /// Returns one channel of a sum as a floating-point number.
  double value(size_t sum_index, size_t channel) const {
    const FixedPoint coarse{unit_.exponent + kCoarseExponent};
    const Sum& sum = sums_[sum_index];
    return unit_.to_double(sum[channel]) + coarse.to_double(sum[channel + 3]);
  }
  std::vector<Sum>& sums() { return sums_; }
  const std::vector<Sum>& sums() const { return sums_; }

  static void plus(int64_t& sum, int64_t x) {
    if (x != 0) std::atomic_ref(sum).fetch_add(x, std::memory_order_relaxed);
  }

 private:
  FixedPoint unit_;
  double scale_ = 1;
  std::vector<Sum> sums_;
};

/// Factor by which sums of light splats are multiplied to get pixel values. The factor is the
/// number of light paths per pixel sample (`numbers`) divided by the number of traced light paths
/// (`paths`).
struct LightSplatScale {
  double numbers = 1, paths = 0;

  double of(double sum) const { return paths > 0 ? sum * numbers / paths : 0.0; }
  std::array<double, 3> of(const LightSplatSums& sums, size_t sum_index) const {
    return {of(sums.value(sum_index, 0)), of(sums.value(sum_index, 1)),
            of(sums.value(sum_index, 2))};
  }
};

/// Sums of the light splats of each pixel for the beauty, and the numbers of traced light paths.
///
/// Contract: several threads may call add() and done() at the same time, but only one thread calls
/// done() for a light path index. Other members may be called only while no thread calls add() or
/// done().
class LightSplatLayer {
 public:
  using Sum = LightSplatSums::Sum;

  LightSplatLayer() = default;
  /// Allocates the sums. `paths` is the number of light path indices. Each index stands for `scale`
  /// light paths per sample. If `with_error` is true, the splats of one half of the samples are
  /// also summed separately, for error estimates.
  LightSplatLayer(size_t pixels, FixedPoint unit, size_t paths = 0, double scale = 1,
                  bool with_error = false)
      : sums_(pixels, unit),
        half_(with_error ? LightSplatSums(pixels, unit) : LightSplatSums()),
        samples_(paths),
        scale_(scale) {}

  bool empty() const { return sums_.empty(); }
  bool has_error() const { return !half_.empty(); }
  /// Adds the light splats of `list` to the sums.
  void add(const LightSplatList& list) {
    for (const LightSplatList::LightSplat& s : list.splats()) {
      sums_.add(s.pixel, s.r, s.g, s.b);
      if (s.in_half && has_error()) half_.add(s.pixel, s.r, s.g, s.b);
    }
  }
  /// Adds the light splats of `list` to the sums, and adds `paths` to the number of traced light
  /// paths.
  void add(const LightSplatList& list, uint32_t paths) {
    add(list);
    LightSplatSums::plus(paths_[0], paths);
  }
  /// Returns whether splats of sample number `sample` are also added to the separate sums for error
  /// estimates, which contain every second sample. The two halves are independent, since light
  /// paths of different sample indices use separate sequences (light_paths/light_path.h).
  static bool is_in_half(uint32_t sample) { return sample % 2 == 0; }
  /// Records that light paths with the index `path` were traced for the samples `first` to `first +
  /// count - 1`.
  void done(size_t path, uint32_t first, uint32_t count) {
    samples_[path] += count;
    LightSplatSums::plus(paths_[0], count);
    if (has_error()) LightSplatSums::plus(paths_[1], (first + count + 1) / 2 - (first + 1) / 2);
  }
  /// Returns the number of samples that were traced for each light path index.
  const std::vector<uint32_t>& samples() const { return samples_; }
  /// Returns the factor by which the current sums are multiplied to get means.
  LightSplatScale scale() const { return scale_of(paths_[0]); }
  /// Returns the mean RGB contribution of light paths to a pixel.
  std::array<double, 3> mean(size_t pixel) const { return scale().of(sums_, pixel); }
  /// Returns the mean of all samples minus the mean of one half of the samples, multiplied by a
  /// factor that makes the expected square equal to the variance of the mean. Returns 0 if one of
  /// the two halves has no light paths.
  std::array<double, 3> difference(size_t pixel) const {
    if (!has_error() || paths_[1] == 0 || paths_[1] == paths_[0]) return {};
    std::array<double, 3> out = mean(pixel);
    const std::array<double, 3> half = scale_of(paths_[1]).of(half_, pixel);
    const double size =
        std::sqrt(static_cast<double>(paths_[1]) / static_cast<double>(paths_[0] - paths_[1]));
    for (size_t c = 0; c < 3; ++c) out[c] = (out[c] - half[c]) * size;
    return out;
  }
  const std::vector<Sum>& sums() const { return sums_.sums(); }
  size_t bytes() const {
    return sums_.bytes() + half_.bytes() + samples_.size() * sizeof(uint32_t);
  }
  /// Calls `block(name, values)` for each vector of sums, to write or read checkpoints.
  template <typename Block>
  void for_each_block(const Block& block) {
    if (empty()) return;
    block("splats", sums_.sums());
    block("splat_half", half_.sums());
    block("splat_paths", paths_);
    block("splat_samples", samples_);
  }

 private:
  LightSplatScale scale_of(int64_t paths) const {
    return {scale_ * static_cast<double>(std::max<size_t>(1, samples_.size())),
            static_cast<double>(paths)};
  }

  LightSplatSums sums_, half_;
  /// Number of all traced light paths, and number of light paths in the half of the samples that is
  /// used for error estimates.
  std::vector<int64_t> paths_ = std::vector<int64_t>(2);
  std::vector<uint32_t> samples_;
  double scale_ = 1;
};

}  // namespace wavecomb
