// SPDX-License-Identifier: Apache-2.0
/// Costs that a render has measured, by name.
#pragma once

#include <string>
#include <utility>
#include <vector>

namespace wavecomb {

/// Costs by name of material and of texture, nanoseconds a record: a profile that a later render of
/// the same stage can start from.
struct CostProfile {
  std::vector<std::pair<std::string, float>> materials, textures;
};

}  // namespace wavecomb
