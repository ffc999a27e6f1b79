// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/schedule/policies/policies.h"

namespace wavecomb {
namespace {

/// Sorts by program, then by estimated material cost in ascending order, then by material id, so
/// that the records of a material stay together.
class MaterialPolicy final : public SchedulingPolicy {
 public:
  std::string_view name() const override { return "material"; }
  bool order(const ShadingQueueView& queue, const CostSnapshot& costs,
             std::span<uint64_t> keys) const override {
    for (size_t i = 0; i < queue.size(); ++i) {
      const uint32_t material = queue.material[i];
      keys[i] = (uint64_t{queue.program[i]} << 56) |
                (ascending_bits(costs.material(material)) << 24) | (material & 0xffffffu);
    }
    return true;
  }
};

}  // namespace

std::unique_ptr<SchedulingPolicy> make_material_policy() {
  return std::make_unique<MaterialPolicy>();
}

}  // namespace wavecomb
