// SPDX-License-Identifier: Apache-2.0
/// Light that reaches pixels other than a path's own, as that of paths from the lights does.
///
/// Sums are integers, so they are the same in any order: any wave adds to any pixel, at any time.
/// A wave collects its splats in a SplatList of its own; between stages its worker adds them to the
/// film's SplatLayer.
#pragma once

#include <algorithm>
#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "wavecomb/core/fixed_point.h"

namespace wavecomb {

/// Contract: owned by one worker; allocates only when it is made.
class SplatList {
 public:
  struct Splat {
    uint32_t pixel;  ///< Film::index
    float r, g, b;
    bool in_half = false;  ///< SplatLayer::is_in_half of the path's sample
  };

  SplatList() = default;
  explicit SplatList(size_t capacity) { splats_.reserve(capacity); }

  /// Adds light to a pixel; false where the list is full, and the splat is not in it.
  [[nodiscard]] bool add(const Splat& splat) {
    if (splats_.size() == splats_.capacity()) return false;
    splats_.push_back(splat);
    return true;
  }
  void clear() { splats_.clear(); }
  size_t bytes() const { return splats_.capacity() * sizeof(Splat); }
  std::span<const Splat> splats() const { return splats_; }

 private:
  std::vector<Splat> splats_;
};

/// Sums of splats by place.
///
/// Sizes of splats differ more than the bits of a sum allow for: those of `kLeastCoarse` units and
/// more go to a second sum in units 2^kCoarseExponent as large, whichever path they came of.
///
/// Contract: add() may be called by all workers at once; the others while none adds.
class SplatSums {
 public:
  /// Red, green and blue in units; then the same of large splats.
  using Sum = std::array<int64_t, 6>;
  /// A coarse unit in fine ones, and the least splat that is counted in them, in fine units.
  static constexpr int kCoarseExponent = 20;
  static constexpr double kLeastCoarse = 0x1p40;

  SplatSums() = default;
  SplatSums(size_t places, FixedPoint unit)
      : unit_(unit), scale_(std::ldexp(1.0, -unit.exponent)), sums_(places) {}

  bool empty() const { return sums_.empty(); }
  size_t bytes() const { return sums_.size() * sizeof(Sum); }
  /// Adds with atomic additions.
  void add(size_t place, float r, float g, float b) {
    const FixedPoint coarse{unit_.exponent + kCoarseExponent};
    Sum& sum = sums_[place];
    const float rgb[3] = {r, g, b};
    for (size_t c = 0; c < 3; ++c) {
      const double units = double{rgb[c]} * scale_;
      if (std::abs(units) < kLeastCoarse)
        plus(sum[c], static_cast<int64_t>(std::nearbyint(units)));
      else
        plus(sum[c + 3], coarse.from(rgb[c]));
    }
  }
  double value(size_t place, size_t channel) const {
    const FixedPoint coarse{unit_.exponent + kCoarseExponent};
    const Sum& sum = sums_[place];
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

/// What makes of sums of splats what all paths bring: the mean over the `paths` that were traced,
/// times the `numbers` of paths that a sample has.
struct SplatScale {
  double numbers = 1, paths = 0;

  double of(double sum) const { return paths > 0 ? sum * numbers / paths : 0.0; }
  std::array<double, 3> of(const SplatSums& sums, size_t place) const {
    return {of(sums.value(place, 0)), of(sums.value(place, 1)), of(sums.value(place, 2))};
  }
};

/// Splats by pixel, of numbered paths.
///
/// Contract: add() and done() may be called by all workers at once, done() for its own paths; the
/// others while none adds.
class SplatLayer {
 public:
  using Sum = SplatSums::Sum;

  SplatLayer() = default;
  /// `paths`: how many numbers of paths there are, each of which stands for `scale` paths a sample.
  /// `with_error`: keeps a half of the samples by itself.
  SplatLayer(size_t pixels, FixedPoint unit, size_t paths = 0, double scale = 1,
             bool with_error = false)
      : sums_(pixels, unit),
        half_(with_error ? SplatSums(pixels, unit) : SplatSums()),
        samples_(paths),
        scale_(scale) {}

  bool empty() const { return sums_.empty(); }
  bool has_error() const { return !half_.empty(); }
  /// Adds the splats of `list`.
  void add(const SplatList& list) {
    for (const SplatList::Splat& s : list.splats()) {
      sums_.add(s.pixel, s.r, s.g, s.b);
      if (s.in_half && has_error()) half_.add(s.pixel, s.r, s.g, s.b);
    }
  }
  /// Adds `list`, which came of `paths` paths.
  void add(const SplatList& list, uint32_t paths) {
    add(list);
    SplatSums::plus(paths_[0], paths);
  }
  /// Whether a path's sample is of the half: samples are sequences of their own, so every other
  /// one is.
  static bool is_in_half(uint32_t sample) { return sample % 2 == 0; }
  /// The path of number `path` was traced for samples [first, first + count) too.
  void done(size_t path, uint32_t first, uint32_t count) {
    samples_[path] += count;
    SplatSums::plus(paths_[0], count);
    if (has_error()) SplatSums::plus(paths_[1], (first + count + 1) / 2 - (first + 1) / 2);
  }
  /// By path, how many samples of it there are.
  const std::vector<uint32_t>& samples() const { return samples_; }
  /// Makes means of sums of these paths' splats.
  SplatScale scale() const { return scale_of(paths_[0]); }
  /// What all paths bring a pixel.
  std::array<double, 3> mean(size_t pixel) const { return scale().of(sums_, pixel); }
  /// The same less what the half alone says of it, as large as the error of the mean is: the two
  /// halves are independent. Zero where there is no other half.
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
  /// Runs block(name, values) for each vector of sums, for checkpoints.
  template <typename Block>
  void for_each_block(const Block& block) {
    if (empty()) return;
    block("splats", sums_.sums());
    block("splat_half", half_.sums());
    block("splat_paths", paths_);
    block("splat_samples", samples_);
  }

 private:
  SplatScale scale_of(int64_t paths) const {
    return {scale_ * static_cast<double>(std::max<size_t>(1, samples_.size())),
            static_cast<double>(paths)};
  }

  SplatSums sums_, half_;
  std::vector<int64_t> paths_ = std::vector<int64_t>(2);  ///< all; those of the half
  std::vector<uint32_t> samples_;
  double scale_ = 1;
};

}  // namespace wavecomb
