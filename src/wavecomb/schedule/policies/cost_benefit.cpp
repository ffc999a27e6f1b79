// SPDX-License-Identifier: Apache-2.0
#include <algorithm>

#include "wavecomb/schedule/policies/policies.h"

namespace wavecomb {
namespace {

/// Sorts by program, then by
///   score = sum of the throughput of the material's records / (material cost + texture cost),
/// highest first, then by the Morton code of the hit. All records of a material in a queue have the
/// same score.
class CostBenefitPolicy final : public SchedulingPolicy {
 public:
  std::string_view name() const override { return "cost-benefit"; }
  uint32_t columns() const override { return kThroughputColumn | kPositionColumn; }
  bool order(const ShadingQueueView& queue, const CostSnapshot& costs,
             std::span<uint64_t> keys) const override {
    const std::span<float> score = queue.scratch;
    std::fill(score.begin(), score.end(), 0.f);
    for (size_t i = 0; i < queue.size(); ++i) score[queue.material[i]] += queue.throughput[i];
    for (uint32_t m = 0; m < score.size(); ++m) {
      const float cost = costs.material(m) + costs.texture(queue.materials[m].texture);
      score[m] /= std::max(cost, 1e-3f);
    }
    for (size_t i = 0; i < queue.size(); ++i) {
      // 26 bits of the score suffice to separate materials. The bits of the score are inverted to
      // sort the highest score first.
      const uint64_t rank = (~ascending_bits(score[queue.material[i]]) & 0xffffffffu) >> 6;
      keys[i] = (uint64_t{queue.program[i]} << 56) | (rank << 30) | queue.position_key[i];
    }
    return true;
  }
};

}  // namespace

std::unique_ptr<SchedulingPolicy> make_cost_benefit_policy() {
  return std::make_unique<CostBenefitPolicy>();
}

}  // namespace wavecomb
