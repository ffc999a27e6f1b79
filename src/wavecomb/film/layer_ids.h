// SPDX-License-Identifier: Apache-2.0
/// Ids in layers of floats.
#pragma once

#include <cstdint>

#include "wavecomb/core/aov.h"

namespace wavecomb {

/// Ids that a layer of floats tells apart: whole numbers up to 2^24.
inline constexpr uint64_t kMaxLayerIds = uint64_t{1} << 24;

/// Throws Error naming the layer where `set` asks for ids of more instances (the world among them)
/// or materials than that.
void check_id_layers(const AovSet& set, uint64_t instances, uint64_t materials);

}  // namespace wavecomb
