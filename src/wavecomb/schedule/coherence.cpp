// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/schedule/coherence.h"

namespace wavecomb {

void measure_coherence(std::span<const uint32_t> material, std::span<const uint32_t> texture_key,
                       std::span<const uint32_t> order, std::span<const MaterialTraits> materials,
                       CoherenceCounts& counts) {
  const size_t n = material.size();
  if (n == 0) return;
  const auto at = [&](size_t i) { return order.empty() ? i : order[i]; };
  counts.records += n;
  ++counts.runs;
  for (size_t i = 1; i < n; ++i) {
    const size_t a = at(i - 1), b = at(i);
    const uint32_t ma = material[a], mb = material[b];
    ++counts.pairs;
    if (ma == mb)
      ++counts.same_material;
    else
      ++counts.runs;
    const uint32_t ta = materials[ma].texture, tb = materials[mb].texture;
    if (ta == MaterialTraits::kNone || tb == MaterialTraits::kNone) continue;
    ++counts.texture_pairs;
    if (ta == tb && texture_key[a] == texture_key[b]) ++counts.same_texels;
  }
}

}  // namespace wavecomb
