// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/schedule/policies/policies.h"

namespace wavecomb {
namespace {

/// Control for experiments: the same runs as "material", but in a pseudo-random order. Any benefit
/// of ordering runs must be measured against this policy.
class RandomRunsPolicy final : public SchedulingPolicy {
 public:
  std::string_view name() const override { return "random-runs"; }
  bool order(const ShadingQueueView& queue, const CostSnapshot&,
             std::span<uint64_t> keys) const override {
    const uint32_t salt = queue.depth * 0x9e3779b9u + static_cast<uint32_t>(queue.size());
    for (size_t i = 0; i < queue.size(); ++i) {
      // Records of a program stay together, as with every other policy, so that lane utilisation is
      // the same.
      const uint32_t program = mix(queue.program[i] + salt) & 0xffu;
      const uint32_t run = mix(queue.material[i] * 0x85ebca6bu + salt);
      keys[i] = (uint64_t{program} << 56) | (uint64_t{queue.program[i]} << 48) |
                (uint64_t{run & 0xffffffu} << 24) | (queue.material[i] & 0xffffffu);
    }
    return true;
  }

 private:
  /// Finaliser of MurmurHash3 (A. Appleby).
  static uint32_t mix(uint32_t x) {
    x = (x ^ (x >> 16)) * 0x85ebca6bu;
    x = (x ^ (x >> 13)) * 0xc2b2ae35u;
    return x ^ (x >> 16);
  }
};

}  // namespace

std::unique_ptr<SchedulingPolicy> make_random_runs_policy() {
  return std::make_unique<RandomRunsPolicy>();
}

}  // namespace wavecomb
