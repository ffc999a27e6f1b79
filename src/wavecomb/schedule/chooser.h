// SPDX-License-Identifier: Apache-2.0
/// Online choice among several ways to do the same work, based on measured times.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

namespace wavecomb {

/// Expected work of one arm for one shading queue: number of packets to shade and of records to
/// sort or move.
struct Work {
  double packets = 0;
  double records = 0;
};

/// Chooser among several ways ("arms") to process a queue. The chooser predicts the time of each
/// arm as
///   packets * (ns per packet) + records * (ns per record to prepare)
/// and chooses the arm with the smallest time. Both costs are exponential moving averages per path
/// depth and arm. Arms without measurements are chosen first. Later the chooser occasionally
/// retries an arm whose predicted time is nearly the best, since costs vary over the image. It
/// rarely retries any other arm. Measurements are clamped to twice the average, since other
/// programs on the machine may slow down a measurement.
///
/// Contract: owned by one worker. The choice affects render time but never the image.
class Chooser {
 public:
  /// queues at greater path depths share the statistics of the last depth
  static constexpr uint32_t kDepths = 16;

  explicit Chooser(size_t arms = 0) : arms_(arms), stats_(arms * kDepths) {}

  /// Returns the arm to use for a queue of this depth; `work` has one entry per arm.
  size_t choose(uint32_t depth, std::span<const Work> work);
  /// Records the measured times of an arm: `run_ns` to run its packets, `prepare_ns` to prepare its
  /// records, both in nanoseconds.
  void learn(uint32_t depth, size_t arm, const Work& work, double run_ns, double prepare_ns);
  /// Returns how often each arm was chosen.
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
  static constexpr uint32_t kExplorePeriod = 8;
  static constexpr double kOutlier = 2;
  static constexpr double kSimilarCost = 1.15;
  static constexpr double kWeight = 0.2;

  size_t arms_;
  std::vector<Stat> stats_;
  std::vector<uint64_t> used_ = std::vector<uint64_t>(arms_);
  std::array<uint32_t, kDepths> calls_{};
};

}  // namespace wavecomb
