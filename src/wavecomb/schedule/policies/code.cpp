// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/schedule/policies/policies.h"

namespace wavecomb {
namespace {

/// All the code that lanes run together: the program, and within it the value graph, since graphs
/// that meet in a packet run one after another. Where no material has a graph, the keys are those
/// of "program", and the sort has one digit.
class CodePolicy final : public SchedulingPolicy {
 public:
  std::string_view name() const override { return "code"; }
  bool order(const ShadingQueueView& queue, const CostSnapshot&,
             std::span<uint64_t> keys) const override {
    for (size_t i = 0; i < queue.size(); ++i) {
      const uint32_t graph = queue.materials[queue.material[i]].graph + 1;  // none: 0
      keys[i] = (uint64_t{queue.program[i]} << 32) | graph;
    }
    return true;
  }
};

}  // namespace

std::unique_ptr<SchedulingPolicy> make_code_policy() {
  return std::make_unique<CodePolicy>();
}

}  // namespace wavecomb
