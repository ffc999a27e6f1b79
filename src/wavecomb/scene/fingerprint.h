// SPDX-License-Identifier: Apache-2.0
/// Fingerprints that distinguish scenes, one hash for each part of the scene.
#pragma once

#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "wavecomb/scene/scene.h"

namespace wavecomb {

/// Returns hashes of everything that affects the image, as (part, hash): "geometry", "materials",
/// "textures", "lights", "camera", and "names", which appear in AOVs. `arrays` includes geometry
/// and textures, of which every byte is read.
std::vector<std::pair<std::string, uint64_t>> fingerprint(const Scene& scene, bool arrays = true);

}  // namespace wavecomb
