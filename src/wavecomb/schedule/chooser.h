// SPDX-License-Identifier: Apache-2.0
/// Learns, per depth, which of several ways to do the same work is quickest.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

namespace wavecomb {

/// What a way of doing a queue is expected to need: packets to run, records to prepare.
struct Work {
  double packets = 0;
  double records = 0;
};

/// Predicts the time of each way ("arm") as
///   packets * (ns per packet) + records * (ns per record to prepare),
/// both learned by exponential averages per depth and arm, and chooses the least. An arm that was
/// not tried at a depth is tried first; later a way that is not far behind is tried again now and
/// then, since scenes change from place to place, and any other rarely. A slow measurement counts
/// as twice the average at most, since it may be the machine's doing.
///
/// Contract: owned by one worker. What it chooses changes no picture, only time.
class Chooser {
 public:
  static constexpr uint32_t kDepths = 16;  ///< deeper ones share the last

  explicit Chooser(size_t arms = 0) : arms_(arms), stats_(arms * kDepths) {}

  /// The arm to use for a queue of this depth; `work` has an entry for each arm.
  size_t choose(uint32_t depth, std::span<const Work> work);
  /// What it took.
  void learn(uint32_t depth, size_t arm, const Work& work, double run_ns, double prepare_ns);
  /// How often each arm was used.
  std::span<const uint64_t> used() const { return used_; }

 private:
  struct Stat {
    double packet_ns = 0, record_ns = 0;
    uint32_t tries = 0;
  };
  static uint32_t row(uint32_t depth) { return depth < kDepths ? depth : kDepths - 1; }
  Stat& stat(uint32_t depth, size_t arm) { return stats_[row(depth) * arms_ + arm]; }

  static constexpr uint32_t kFirstTries = 4;
  static constexpr uint32_t kRetryPeriod = 64;
  static constexpr uint32_t kAnywayPeriod = 8;
  static constexpr double kOutlier = 2;
  static constexpr double kNearlyAsGood = 1.15;
  static constexpr double kWeight = 0.2;

  size_t arms_;
  std::vector<Stat> stats_;
  std::vector<uint64_t> used_ = std::vector<uint64_t>(arms_);
  std::array<uint32_t, kDepths> calls_{};
};

}  // namespace wavecomb
