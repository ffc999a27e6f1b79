// SPDX-License-Identifier: Apache-2.0
/// Check that ids fit into float layers.
#pragma once

#include <cstdint>

#include "wavecomb/core/aov.h"

namespace wavecomb {

/// Largest number of ids that a float layer can distinguish: integers up to 2^24 are exact.
inline constexpr uint64_t kMaxLayerIds = uint64_t{1} << 24;

/// Throws Error that names the layer if `set` includes an id layer and the scene has more instances
/// (including the world) or materials than kMaxLayerIds.
void check_id_layers(const AovSet& set, uint64_t instances, uint64_t materials);

}  // namespace wavecomb
