// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/schedule/cost_tracker.h"

#include <cmath>

namespace wavecomb {

void CostTracker::charge(std::span<const uint32_t> materials, double ns) {
  const double each = ns / static_cast<double>(materials.size());
  for (uint32_t m : materials) {
    ns_[m] += each;
    ++timed_[m];
  }
}

void CostTracker::take(CostTracker& other) {
  for (size_t m = 0; m < ns_.size(); ++m) {
    const uint64_t records = other.record_counts_[m] - other.counts_before_[m];
    const double untimed = records > 0 ? other.untimed_ns_[m] / static_cast<double>(records) : 0;
    ns_[m] += other.ns_[m] + untimed * static_cast<double>(other.timed_[m]);
    timed_[m] += other.timed_[m];
    other.ns_[m] = 0;
    other.untimed_ns_[m] = 0;
    other.counts_before_[m] = other.record_counts_[m];
    other.timed_[m] = 0;
  }
}

CostPrediction merge_costs(const CostTracker& measured, std::span<const MaterialTraits> materials,
                           float weight, CostSnapshot& costs) {
  CostPrediction prediction;
  double sum_w = 0, sum_measured = 0;
  // sums over the materials that had a cost estimate before this pass
  double compared_w = 0, compared = 0;
  for (size_t m = 0; m < materials.size(); ++m) {
    const auto w = static_cast<double>(measured.timed()[m]);
    sum_w += w;
    sum_measured += measured.ns()[m];
    if (costs.material_ns[m] <= 0) continue;
    compared_w += w;
    compared += measured.ns()[m];
  }
  if (sum_w == 0) return prediction;
  const double mean = compared_w > 0 ? compared / compared_w : 0;

  double residual = 0, variance = 0, error = 0;
  std::vector<double> texture_ns(costs.texture_ns.size());
  std::vector<double> texture_records(costs.texture_ns.size());
  for (size_t m = 0; m < materials.size(); ++m) {
    const auto records = static_cast<double>(measured.timed()[m]);
    if (records == 0) continue;
    const double ns = measured.ns()[m] / records;
    const double expected = costs.material_ns[m];
    if (expected > 0) {
      ++prediction.materials;
      residual += records * (ns - expected) * (ns - expected);
      variance += records * (ns - mean) * (ns - mean);
      error += records * std::abs(ns - expected);
    }
    costs.material_ns[m] =
        static_cast<float>(expected > 0 ? (1 - weight) * expected + weight * ns : ns);
    const uint32_t texture = materials[m].texture;
    if (texture < texture_ns.size()) {
      texture_ns[texture] += measured.ns()[m];
      texture_records[texture] += records;
    }
  }
  for (size_t t = 0; t < texture_ns.size(); ++t) {
    if (texture_records[t] == 0) continue;
    const double ns = texture_ns[t] / texture_records[t];
    float& cost = costs.texture_ns[t];
    cost = static_cast<float>(cost > 0 ? (1 - weight) * cost + weight * ns : ns);
  }
  costs.mean_ns = static_cast<float>(sum_measured / sum_w);
  prediction.r2 = variance > 0 ? 1 - residual / variance : (residual > 0 ? 0 : 1);
  prediction.mean_error = compared > 0 ? error / compared : 0;
  return prediction;
}

}  // namespace wavecomb
