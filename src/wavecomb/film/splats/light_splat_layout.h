// SPDX-License-Identifier: Apache-2.0
/// Order of the sums of light splats of different AOV layers within a pixel.
#pragma once

#include <cstdint>

#include "wavecomb/core/aov.h"

namespace wavecomb {

/// Position of each AOV layer among the sums of light splats in a pixel. A light path that reaches
/// the camera has scattered at least once, so a splat is direct light (one scattering) or indirect
/// light (several scatterings), but never emission.
struct LightSplatLayout {
  /// Position of layers that are not stored.
  static constexpr uint32_t kNotStored = 0xffffffffu;

  uint32_t direct = kNotStored, indirect = kNotStored;
  uint32_t first_group = kNotStored, first_expression = kNotStored;
  uint32_t count = 0;  ///< number of sums of light splats per pixel

  LightSplatLayout() = default;
  explicit LightSplatLayout(const AovLayout& layout) {
    const auto allocate = [&](bool wanted, uint32_t layers) {
      if (!wanted || layers == 0) return kNotStored;
      count += layers;
      return count - layers;
    };
    direct = allocate(layout.set.has(Aov::kDirect), 1);
    indirect = allocate(layout.set.has(Aov::kIndirect), 1);
    first_group = allocate(layout.set.has(Aov::kLightGroups), layout.light_groups);
    first_expression = allocate(layout.set.has(Aov::kExpressions), layout.expressions);
  }

  /// Returns the position of layer number `which` of an AOV. `which` is 0 for AOVs with a single
  /// layer.
  uint32_t of(Aov aov, uint32_t which = 0) const {
    const uint32_t first = aov == Aov::kDirect        ? direct
                           : aov == Aov::kIndirect    ? indirect
                           : aov == Aov::kLightGroups ? first_group
                           : aov == Aov::kExpressions ? first_expression
                                                      : kNotStored;
    return first == kNotStored ? kNotStored : first + which;
  }
};

}  // namespace wavecomb
