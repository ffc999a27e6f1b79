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

/// Sums of splats by pixel.
///
/// Sizes of splats differ more than the bits of a sum allow for: those of `kCoarse` units and more
/// go to a second sum in units of as much, whichever path they came of.
///
/// Contract: add() and done() may be called by all workers at once, done() for its own paths; the
/// others while none adds.
class SplatLayer {
 public:
  /// Red, green and blue in units of SplatLayer::unit; then the same of large splats.
  using Sum = std::array<int64_t, 6>;
  /// A coarse unit in fine ones, and the least splat that is counted in them, in fine units.
  static constexpr int kCoarseExponent = 20;
  static constexpr double kLeastCoarse = 0x1p40;

  SplatLayer() = default;
  /// `paths`: how many numbers of paths there are, each of which stands for `scale` paths a sample.
  SplatLayer(size_t pixels, FixedPoint unit, size_t paths = 0, double scale = 1)
      : unit_(unit), sums_(pixels), samples_(paths), scale_(scale) {}

  bool empty() const { return sums_.empty(); }
  /// Adds the splats of `list` with atomic additions.
  void add(const SplatList& list) {
    const double scale = std::ldexp(1.0, -unit_.exponent);
    const FixedPoint coarse{unit_.exponent + kCoarseExponent};
    for (const SplatList::Splat& s : list.splats()) {
      Sum& sum = sums_[s.pixel];
      const float rgb[3] = {s.r, s.g, s.b};
      for (size_t c = 0; c < 3; ++c) {
        const double units = double{rgb[c]} * scale;
        if (std::abs(units) < kLeastCoarse)
          plus(sum[c], static_cast<int64_t>(std::nearbyint(units)));
        else
          plus(sum[c + 3], coarse.from(rgb[c]));
      }
    }
  }
  /// Adds `list`, which came of `paths` paths.
  void add(const SplatList& list, uint32_t paths) {
    add(list);
    plus(paths_[0], paths);
  }
  /// The path of number `path` was traced for `samples` more samples.
  void done(size_t path, uint32_t samples) {
    samples_[path] += samples;
    plus(paths_[0], samples);
  }
  /// By path, how many samples of it there are.
  const std::vector<uint32_t>& samples() const { return samples_; }
  /// What all paths bring a pixel: the mean over their samples of the sum over their numbers (of
  /// one number, where there are none).
  std::array<double, 3> mean(size_t pixel) const {
    std::array<double, 3> out{};
    if (paths_[0] == 0) return out;
    const FixedPoint coarse{unit_.exponent + kCoarseExponent};
    const auto numbers = scale_ * static_cast<double>(std::max<size_t>(1, samples_.size()));
    for (size_t c = 0; c < 3; ++c)
      out[c] = (unit_.to_double(sums_[pixel][c]) + coarse.to_double(sums_[pixel][c + 3])) *
               numbers / static_cast<double>(paths_[0]);
    return out;
  }
  const std::vector<Sum>& sums() const { return sums_; }
  size_t bytes() const { return sums_.size() * sizeof(Sum) + samples_.size() * sizeof(uint32_t); }
  /// Runs block(name, values) for each vector of sums, for checkpoints.
  template <typename Block>
  void for_each_block(const Block& block) {
    if (empty()) return;
    block("splats", sums_);
    block("splat_paths", paths_);
    block("splat_samples", samples_);
  }

 private:
  static void plus(int64_t& sum, int64_t x) {
    if (x != 0) std::atomic_ref(sum).fetch_add(x, std::memory_order_relaxed);
  }

  FixedPoint unit_;
  std::vector<Sum> sums_;
  std::vector<int64_t> paths_ = std::vector<int64_t>(1);
  std::vector<uint32_t> samples_;
  double scale_ = 1;
};

}  // namespace wavecomb
