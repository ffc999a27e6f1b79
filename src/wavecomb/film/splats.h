// SPDX-License-Identifier: Apache-2.0
/// Light that reaches pixels other than a path's own, as that of paths from the lights does.
///
/// Sums are integers, so they are the same in any order: any wave adds to any pixel, at any time.
/// A wave collects its splats in a SplatList of its own; between waves its worker adds them to the
/// film's SplatLayer.
#pragma once

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

  explicit SplatList(size_t capacity) { splats_.reserve(capacity); }

  /// Adds light to a pixel; false where the list is full, and the splat is not in it.
  [[nodiscard]] bool add(const Splat& splat) {
    if (splats_.size() == splats_.capacity()) return false;
    splats_.push_back(splat);
    return true;
  }
  void clear() { splats_.clear(); }
  std::span<const Splat> splats() const { return splats_; }

 private:
  std::vector<Splat> splats_;
};

/// Sums of splats by pixel.
///
/// Contract: add() may be called by all workers at once; the others while none adds.
class SplatLayer {
 public:
  /// Red, green and blue in units of SplatLayer::unit.
  using Sum = std::array<int64_t, 3>;

  SplatLayer() = default;
  SplatLayer(size_t pixels, FixedPoint unit) : unit_(unit), sums_(pixels) {}

  bool empty() const { return sums_.empty(); }
  /// Adds the splats of `list`, which came of `paths` paths, with atomic additions.
  void add(const SplatList& list, uint32_t paths) {
    const auto plus = [](int64_t& sum, int64_t x) {
      if (x != 0) std::atomic_ref(sum).fetch_add(x, std::memory_order_relaxed);
    };
    for (const SplatList::Splat& s : list.splats()) {
      Sum& sum = sums_[s.pixel];
      plus(sum[0], unit_.from(s.r));
      plus(sum[1], unit_.from(s.g));
      plus(sum[2], unit_.from(s.b));
    }
    plus(paths_[0], paths);
  }
  /// The mean over all paths of what they brought a pixel.
  std::array<double, 3> mean(size_t pixel) const {
    std::array<double, 3> out{};
    if (paths_[0] == 0) return out;
    for (size_t c = 0; c < 3; ++c)
      out[c] = unit_.to_double(sums_[pixel][c]) / static_cast<double>(paths_[0]);
    return out;
  }
  const std::vector<Sum>& sums() const { return sums_; }
  size_t bytes() const { return sums_.size() * sizeof(Sum); }
  /// Runs block(name, values) for each vector of sums, for checkpoints.
  template <typename Block>
  void for_each_block(const Block& block) {
    if (empty()) return;
    block("splats", sums_);
    block("splat_paths", paths_);
  }

 private:
  FixedPoint unit_;
  std::vector<Sum> sums_;
  std::vector<int64_t> paths_ = std::vector<int64_t>(1);
};

}  // namespace wavecomb
