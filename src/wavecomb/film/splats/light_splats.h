// SPDX-License-Identifier: Apache-2.0
/// Light splats: contributions of light paths, which may land on any pixel.
///
/// Sums are integers, so that the result does not depend on order and any wave may add to any pixel
/// at any time. Each wave collects its light splats in a LightSplatList. Between wave stages, the
/// wave's worker adds the list to the film's LightSplatLayer.
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

/// Bounded buffer of light splats.
///
/// Contract: owned by one worker; allocates only on construction.
class LightSplatList {
 public:
  struct LightSplat {
    uint32_t pixel;  ///< Film::index
    float r, g, b;
    bool in_half = false;  ///< result of LightSplatLayer::is_in_half() for the light path's sample
  };

  LightSplatList() = default;
  explicit LightSplatList(size_t capacity) { splats_.reserve(capacity); }

  /// Adds a light splat. Returns false if the list is full; the splat is then not stored.
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
/// A single 64-bit sum cannot cover the range of splat values. Values of at least `kMinCoarse`
/// units are added to a second sum whose unit is 2^kCoarseExponent times as large.
///
/// Contract: add() may be called concurrently; all other members only while no thread adds.
class LightSplatSums {
 public:
  /// Sums of red, green and blue in fine units, then of red, green and blue in coarse units.
  using Sum = std::array<int64_t, 6>;
  /// Logarithm to base 2 of the ratio of coarse to fine unit, and the smallest value, in fine
  /// units, that is added to the coarse sum.
  static constexpr int kCoarseExponent = 20;
  static constexpr double kMinCoarse = 0x1p40;

  LightSplatSums() = default;
  LightSplatSums(size_t sum_count, FixedPoint unit)
      : unit_(unit), scale_(std::ldexp(1.0, -unit.exponent)), sums_(sum_count) {}

  bool empty() const { return sums_.empty(); }
  size_t bytes() const { return sums_.size() * sizeof(Sum); }
  /// Atomically adds a value to a sum.
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
  /// Returns a sum as a floating-point number in the unit of the added values.
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

/// Scale that turns sums of light splats into pixel values: the number of light paths per pixel
/// sample (`numbers`) divided by the number of light paths traced (`paths`).
struct LightSplatScale {
  double numbers = 1, paths = 0;

  double of(double sum) const { return paths > 0 ? sum * numbers / paths : 0.0; }
  std::array<double, 3> of(const LightSplatSums& sums, size_t sum_index) const {
    return {of(sums.value(sum_index, 0)), of(sums.value(sum_index, 1)),
            of(sums.value(sum_index, 2))};
  }
};

/// Light splats of the beauty, by pixel, and counts of the light paths traced.
///
/// Contract: add() and done() may be called concurrently, done() by one thread per light path
/// index; all other members only while no thread adds.
class LightSplatLayer {
 public:
  using Sum = LightSplatSums::Sum;

  LightSplatLayer() = default;
  /// `paths`: number of light path indices, each of which represents `scale` light paths per
  /// sample. If `with_error`, one half of the samples is also summed separately.
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
  /// Adds the light splats of `list`, which were collected from `paths` light paths.
  void add(const LightSplatList& list, uint32_t paths) {
    add(list);
    LightSplatSums::plus(paths_[0], paths);
  }
  /// Returns whether a sample of a light path is also summed in the half for error estimates. Every
  /// second sample is, since each sample of all light paths uses a separate sequence
  /// (light_paths/light_path.h).
  static bool is_in_half(uint32_t sample) { return sample % 2 == 0; }
  /// Records that light path index `path` was traced for samples [first, first + count).
  void done(size_t path, uint32_t first, uint32_t count) {
    samples_[path] += count;
    LightSplatSums::plus(paths_[0], count);
    if (has_error()) LightSplatSums::plus(paths_[1], (first + count + 1) / 2 - (first + 1) / 2);
  }
  /// Returns the number of samples traced, by light path index.
  const std::vector<uint32_t>& samples() const { return samples_; }
  /// Returns the scale that turns the current sums into means.
  LightSplatScale scale() const { return scale_of(paths_[0]); }
  /// Returns the mean rgb contribution of light paths to a pixel.
  std::array<double, 3> mean(size_t pixel) const { return scale().of(sums_, pixel); }
  /// Returns the mean of all samples minus the mean of the half, scaled so that its expected square
  /// is the variance of the mean (the halves are independent). Returns zero if either half has no
  /// light paths.
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
  /// Calls block(name, values) for each vector of sums, to write or read checkpoints.
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
  /// Numbers of light paths: in total, and in the half.
  std::vector<int64_t> paths_ = std::vector<int64_t>(2);
  std::vector<uint32_t> samples_;
  double scale_ = 1;
};

}  // namespace wavecomb
