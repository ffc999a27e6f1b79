// SPDX-License-Identifier: Apache-2.0
/// Measured shading costs of materials and textures by name.
#pragma once

#include <string>
#include <utility>
#include <vector>

namespace wavecomb {

/// Costs of materials and textures by name, in nanoseconds per shading record. A later render of
/// the same stage can start with these costs.
struct CostProfile {
  std::vector<std::pair<std::string, float>> materials, textures;
};

}  // namespace wavecomb
