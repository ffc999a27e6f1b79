// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/schedule/policies/policies.h"

namespace wavecomb {
namespace {

/// Sorts by program and material, then by texture coordinates: UDIM tile, mip level and Morton code
/// of uv on a 128 x 128 grid (the key of MoonRay's shade queues: Lee et al., HPG 2017).
class TextureLocalityPolicy final : public SchedulingPolicy {
 public:
  std::string_view name() const override { return "texture-locality"; }
  uint32_t columns() const override { return kTextureColumn; }
  bool order(const ShadingQueueView& queue, const CostSnapshot&,
             std::span<uint64_t> keys) const override {
    for (size_t i = 0; i < queue.size(); ++i)
      keys[i] = (uint64_t{queue.program[i]} << 56) |
                (uint64_t{queue.material[i] & 0xffffffu} << 32) | queue.texture_key[i];
    return true;
  }
};

}  // namespace

std::unique_ptr<SchedulingPolicy> make_texture_locality_policy() {
  return std::make_unique<TextureLocalityPolicy>();
}

}  // namespace wavecomb
