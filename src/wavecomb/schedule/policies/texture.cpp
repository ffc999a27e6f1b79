// SPDX-License-Identifier: Apache-2.0
#include <algorithm>

#include "wavecomb/schedule/policies/policies.h"

namespace wavecomb {
namespace {

/// Sorts by program, then by the memory size of the material's largest texture in ascending order.
class TexturePolicy final : public SchedulingPolicy {
 public:
  std::string_view name() const override { return "texture"; }
  bool order(const ShadingQueueView& queue, const CostSnapshot&,
             std::span<uint64_t> keys) const override {
    constexpr uint64_t kLargest = (uint64_t{1} << 56) - 1;
    for (size_t i = 0; i < queue.size(); ++i)
      keys[i] = (uint64_t{queue.program[i]} << 56) |
                std::min(queue.materials[queue.material[i]].texture_bytes, kLargest);
    return true;
  }
};

}  // namespace

std::unique_ptr<SchedulingPolicy> make_texture_policy() {
  return std::make_unique<TexturePolicy>();
}

}  // namespace wavecomb
