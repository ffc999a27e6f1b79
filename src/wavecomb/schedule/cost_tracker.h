// SPDX-License-Identifier: Apache-2.0
/// Shading cost per material and texture, measured by workers and merged between passes.
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

  /// Adds a timed batch: `ns` nanoseconds for one record of each entry of `materials`.
  void charge(std::span<const uint32_t> materials, double ns);
  /// Adds time spent on records of a material outside their timed batches, such as subsurface
  /// random walks. `ns` covers all counted records, timed or not.
  void charge_untimed(uint32_t material, double ns) { untimed_ns_[material] += ns; }
  /// Counts records, timed or not.
  void count(std::span<const uint32_t> materials) {
    for (uint32_t m : materials) ++record_counts_[m];
  }
  /// Returns whether to time the next batch of `records`: one in 8 large batches and one in 32
  /// small ones, so that reading the clock takes less than 1 % of shading time.
  bool wants(size_t records) {
    return records >= 32 ? (++large_ & 7u) == 0 : (++small_ & 31u) == 0;
  }

  /// Total nanoseconds of timed records, by material.
  std::span<const double> ns() const { return ns_; }
  /// Number of timed records, by material.
  std::span<const uint64_t> timed() const { return timed_; }
  /// Number of records, timed or not, by material.
  std::span<const uint64_t> record_counts() const { return record_counts_; }
  /// Adds the measurements of `other` and clears them, except for `record_counts`. The time charged
  /// outside timed batches is averaged over all records of a material and added to its timed
  /// records.
  void take(CostTracker& other);

 private:
  std::vector<double> ns_, untimed_ns_;
  std::vector<uint64_t> timed_, record_counts_, counts_before_;
  uint32_t large_ = 0, small_ = 0;
};

/// Accuracy of the cost estimates that a pass was scheduled with, compared with its measurements.
/// Covers the measured materials that had an estimate, weighted by timed records w.
struct CostPrediction {
  double r2 = 0;           ///< 1 - sum w (measured - predicted)^2 / sum w (measured - mean)^2
  double mean_error = 0;   ///< sum w |measured - predicted| / sum w measured
  uint64_t materials = 0;  ///< number of materials that had both an estimate and a measurement
};

/// Updates the snapshot with the measurements of the last pass:
///   cost <- (1 - weight) cost + weight * measured, or measured if there was no estimate (cost 0).
/// The cost of a texture is the mean over the timed records of materials that read it. Returns the
/// accuracy of the old snapshot.
CostPrediction merge_costs(const CostTracker& measured, std::span<const MaterialTraits> materials,
                           float weight, CostSnapshot& costs);

}  // namespace wavecomb
