// SPDX-License-Identifier: Apache-2.0
/// Fingerprints that distinguish scenes, one hash for each part of the scene.
#pragma once

#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "wavecomb/scene/scene.h"

namespace wavecomb {

/// Returns hashes of everything that affects the image, as pairs (part, hash). The parts are
/// "geometry", "materials", "textures", "lights", "camera", and "names", which stands for names
/// that appear in AOVs. If `arrays` is true, geometry and textures are included, and every byte of
/// them is read.
std::vector<std::pair<std::string, uint64_t>> fingerprint(const Scene& scene, bool arrays = true);

}  // namespace wavecomb
