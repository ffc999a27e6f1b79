// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <vector>

namespace wavecomb {

/// Estimated cost of shading one record, in nanoseconds, frozen while a pass runs.
struct CostSnapshot {
  std::vector<float> material_ns;  ///< per material
  std::vector<float> texture_ns;   ///< per texture: mean of the records that read it
  float mean_ns = 1;               ///< over the records seen, or over materials

  float material(uint32_t id) const { return material_ns[id]; }
  /// Cost of a texture, 0 for none.
  float texture(uint32_t id) const { return id < texture_ns.size() ? texture_ns[id] : 0.f; }
};

}  // namespace wavecomb
