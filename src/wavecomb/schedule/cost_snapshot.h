// SPDX-License-Identifier: Apache-2.0
/// Frozen cost estimates that scheduling policies read.
#pragma once

#include <cstdint>
#include <vector>

namespace wavecomb {

/// Estimated cost of shading one record, in nanoseconds, frozen while a pass runs.
struct CostSnapshot {
  std::vector<float> material_ns;  ///< by material
  /// For each texture: mean cost of the records that read the texture.
  std::vector<float> texture_ns;
  /// mean cost of the measured records; before the first measurement, mean over materials
  float mean_ns = 1;

  float material(uint32_t id) const { return material_ns[id]; }
  /// Returns the cost of a texture, or 0 for no texture.
  float texture(uint32_t id) const { return id < texture_ns.size() ? texture_ns[id] : 0.f; }
};

}  // namespace wavecomb
