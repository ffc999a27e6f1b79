// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/schedule/policies/policies.h"

namespace wavecomb {
namespace {

/// Sorts by program only, which suffices to fill SIMD lanes.
class ProgramPolicy final : public SchedulingPolicy {
 public:
  std::string_view name() const override { return "program"; }
  bool order(const ShadingQueueView& queue, const CostSnapshot&,
             std::span<uint64_t> keys) const override {
    for (size_t i = 0; i < queue.size(); ++i) keys[i] = queue.program[i];
    return true;
  }
};

}  // namespace

std::unique_ptr<SchedulingPolicy> make_program_policy() {
  return std::make_unique<ProgramPolicy>();
}

}  // namespace wavecomb
