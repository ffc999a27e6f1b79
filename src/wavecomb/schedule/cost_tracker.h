// SPDX-License-Identifier: Apache-2.0
/// Measurement of the shading cost per material and texture. Workers measure during a pass, and the
/// measurements are merged between passes.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "wavecomb/schedule/policy.h"

namespace wavecomb {

/// Cost measurements of one worker. The time of a batch is divided evenly among its records.
///
/// Contract: owned by one worker; nothing is allocated after construction.
class CostTracker {
 public:
  explicit CostTracker(size_t materials = 0)
      : ns_(materials),
        untimed_ns_(materials),
        timed_(materials),
        record_counts_(materials),
        counts_before_(materials) {}

  /// Adds a batch of timed shading records. `materials` has the material of each record, and `ns`
  /// is the mean time per record in nanoseconds.
  void charge(std::span<const uint32_t> materials, double ns);
  /// Adds `ns` nanoseconds that were spent on a material outside batches, for example on subsurface
  /// random walks. This time covers all records of the material, not only records of timed batches.
  void charge_untimed(uint32_t material, double ns) { untimed_ns_[material] += ns; }
  /// Counts shading records by material, including records of batches that are not timed.
  void count(std::span<const uint32_t> materials) {
    for (uint32_t m : materials) ++record_counts_[m];
  }
  /// Returns whether to time the next batch, which has `records` records. Every 8th large batch and
  /// every 32nd small batch is timed, so that reading the clock takes less than 1 % of shading
  /// time.
  bool wants(size_t records) {
    return records >= 32 ? (++large_ & 7u) == 0 : (++small_ & 31u) == 0;
  }

  /// Returns the total time of the timed records in nanoseconds, by material.
  std::span<const double> ns() const { return ns_; }
  /// Returns the number of timed records, by material.
  std::span<const uint64_t> timed() const { return timed_; }
  /// Returns the number of all records, including those of batches that are not timed, by material.
  std::span<const uint64_t> record_counts() const { return record_counts_; }
  /// Moves the measurements of `other` to this tracker; `other` keeps only its `record_counts`.
  /// Time that was added by charge_untimed() is averaged over all records of a material, and the
  /// average is added for each timed record.
  void take(CostTracker& other);

 private:
  std::vector<double> ns_, untimed_ns_;
  std::vector<uint64_t> timed_, record_counts_, counts_before_;
  uint32_t large_ = 0, small_ = 0;
};

/// Accuracy of the material costs that were predicted for a pass, compared with the costs measured
/// in the pass. Only materials with both a predicted and a measured cost are included. The weight w
/// of a material is its number of timed records.
struct CostPrediction {
  double r2 = 0;           ///< 1 - sum w (measured - predicted)^2 / sum w (measured - mean)^2
  double mean_error = 0;   ///< sum w |measured - predicted| / sum w measured
  uint64_t materials = 0;  ///< number of materials that had both an estimate and a measurement
};

/// Updates the snapshot with the measurements of the last pass:
///   cost <- (1 - weight) cost + weight * measured, or measured if there was no estimate (cost 0).
/// The cost of a texture is the mean over the timed records of the materials that read the texture.
/// Returns the accuracy of the old snapshot.
CostPrediction merge_costs(const CostTracker& measured, std::span<const MaterialTraits> materials,
                           float weight, CostSnapshot& costs);

}  // namespace wavecomb
