// SPDX-License-Identifier: Apache-2.0
/// Tells one scene from another, part by part.
#pragma once

#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "wavecomb/scene/scene.h"

namespace wavecomb {

/// Hashes of what decides over the picture: "geometry", "materials", "textures", "lights",
/// "camera", and of the "names" that show in AOVs. `arrays`: geometry and textures, too, of which
/// every byte is read.
std::vector<std::pair<std::string, uint64_t>> fingerprint(const Scene& scene, bool arrays = true);

}  // namespace wavecomb
