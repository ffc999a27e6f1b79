// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/schedule/policies/policies.h"

namespace wavecomb {
namespace {

/// Sorts by program. Within a program, materials with textures or value graphs are sorted by
/// material, since a packet evaluates the textures and graphs of different materials one after
/// another. If all materials are constant, the keys are the same as for "program", and the sort
/// takes a single pass.
class CodePolicy final : public SchedulingPolicy {
 public:
  std::string_view name() const override { return "code"; }
  bool order(const ShadingQueueView& queue, const CostSnapshot&,
             std::span<uint64_t> keys) const override {
    for (size_t i = 0; i < queue.size(); ++i) {
      const uint32_t material = queue.material[i];
      const MaterialTraits& traits = queue.materials[material];
      const bool varies = (traits.texture & traits.graph) != MaterialTraits::kNone;
      keys[i] = (uint64_t{queue.program[i]} << 32) | (varies ? material + 1 : 0);
    }
    return true;
  }
};

}  // namespace

std::unique_ptr<SchedulingPolicy> make_code_policy() {
  return std::make_unique<CodePolicy>();
}

}  // namespace wavecomb
