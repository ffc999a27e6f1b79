// SPDX-License-Identifier: Apache-2.0
/// What shading costs, per material and texture: measured by workers, merged between passes.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "wavecomb/schedule/policy.h"

namespace wavecomb {

/// A worker's measurements. Time is taken per batch and charged to the batch's records alike.
///
/// Contract: owned by one worker; nothing is allocated after construction.
class CostTracker {
 public:
  explicit CostTracker(size_t materials = 0)
      : ns_(materials),
        beside_ns_(materials),
        timed_(materials),
        seen_(materials),
        seen_before_(materials) {}

  /// A timed batch: `ns` for records of these materials.
  void charge(std::span<const uint32_t> materials, double ns);
  /// What records of a material cost beside their shading, whether that is timed or not: `ns` for
  /// some of those that have been counted.
  void charge_beside(uint32_t material, double ns) { beside_ns_[material] += ns; }
  /// Counts records, timed or not.
  void count(std::span<const uint32_t> materials) {
    for (uint32_t m : materials) ++seen_[m];
  }
  /// Whether the next batch of `records` is to be timed: large ones now and then, small ones
  /// rarely, so that reading the clock stays below 1 % of shading.
  bool wants(size_t records) {
    return records >= 32 ? (++large_ & 7u) == 0 : (++small_ & 31u) == 0;
  }

  std::span<const double> ns() const { return ns_; }
  std::span<const uint64_t> timed() const { return timed_; }
  std::span<const uint64_t> seen() const { return seen_; }
  /// Adds the other's measurements, and empties it but for `seen`. Its timed records get what all
  /// cost beside, on the mean.
  void take(CostTracker& other);

 private:
  std::vector<double> ns_, beside_ns_;
  std::vector<uint64_t> timed_, seen_, seen_before_;
  uint32_t large_ = 0, small_ = 0;
};

/// How well the costs that a pass was scheduled by met what the pass then measured, over materials
/// that were measured, weighed by timed records.
struct CostPrediction {
  double r2 = 0;           ///< 1 - sum w (measured - predicted)^2 / sum w (measured - mean)^2
  double mean_error = 0;   ///< sum w |measured - predicted| / sum w measured
  uint64_t materials = 0;  ///< how many were compared
};

/// Moves the snapshot towards what was measured in the last pass:
///   cost <- (1 - weight) cost + weight * measured, or measured where nothing was known (cost 0).
/// A texture's cost is the mean over the timed records of materials that read it.
/// Returns how well the old snapshot had predicted.
CostPrediction merge_costs(const CostTracker& measured, std::span<const MaterialTraits> materials,
                           float weight, CostSnapshot& costs);

}  // namespace wavecomb
