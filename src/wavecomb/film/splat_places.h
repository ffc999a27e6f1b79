// SPDX-License-Identifier: Apache-2.0
/// Which layers hold light that paths from the lights bring, and where a pixel keeps it.
#pragma once

#include <cstdint>

#include "wavecomb/core/aov.h"

namespace wavecomb {

/// Numbers of the layers of a layout that are beside each other in a pixel's sums: such light is
/// scattered once, which is direct, or more often, and of a light group. None is emission.
struct SplatPlaces {
  static constexpr uint32_t kNowhere = 0xffffffffu;  ///< that layer is not kept

  uint32_t direct = kNowhere, indirect = kNowhere;
  uint32_t first_group = kNowhere, first_expression = kNowhere;
  uint32_t count = 0;  ///< of them all

  SplatPlaces() = default;
  explicit SplatPlaces(const AovLayout& layout) {
    const auto take = [&](bool wanted, uint32_t layers) {
      if (!wanted || layers == 0) return kNowhere;
      count += layers;
      return count - layers;
    };
    direct = take(layout.set.has(Aov::kDirect), 1);
    indirect = take(layout.set.has(Aov::kIndirect), 1);
    first_group = take(layout.set.has(Aov::kLightGroups), layout.light_groups);
    first_expression = take(layout.set.has(Aov::kExpressions), layout.expressions);
  }

  /// Of an AOV that has one layer, or layer `which` of its several.
  uint32_t of(Aov aov, uint32_t which = 0) const {
    const uint32_t first = aov == Aov::kDirect        ? direct
                           : aov == Aov::kIndirect    ? indirect
                           : aov == Aov::kLightGroups ? first_group
                           : aov == Aov::kExpressions ? first_expression
                                                      : kNowhere;
    return first == kNowhere ? kNowhere : first + which;
  }
};

}  // namespace wavecomb
