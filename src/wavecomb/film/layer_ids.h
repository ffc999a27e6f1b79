// SPDX-License-Identifier: Apache-2.0
/// Check that the ids of a scene can be represented in layers of floats.
#pragma once

#include <cstdint>

#include "wavecomb/core/aov.h"

namespace wavecomb {

/// Largest number of ids that a layer of floats can distinguish, since floats represent integers
/// only up to 2^24 exactly.
inline constexpr uint64_t kMaxLayerIds = uint64_t{1} << 24;

/// Throws an `Error` that names the layer if `set` includes a layer of instance or material ids and
/// the scene has more than `kMaxLayerIds` instances or materials. The number of instances includes
/// instance 0, which contains objects in world space.
void check_id_layers(const AovSet& set, uint64_t instances, uint64_t materials);

}  // namespace wavecomb
