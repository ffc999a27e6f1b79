// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/schedule/policies/policies.h"

namespace wavecomb {
namespace {

/// Keeps arrival order. This policy is the baseline for all other policies.
class NonePolicy final : public SchedulingPolicy {
 public:
  std::string_view name() const override { return "none"; }
  bool keeps_arrival_order() const override { return true; }
  bool order(const ShadingQueueView&, const CostSnapshot&, std::span<uint64_t>) const override {
    return false;
  }
};

}  // namespace

std::unique_ptr<SchedulingPolicy> make_none_policy() {
  return std::make_unique<NonePolicy>();
}

}  // namespace wavecomb
