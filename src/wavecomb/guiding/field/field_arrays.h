// SPDX-License-Identifier: Apache-2.0
/// Arrays of a guiding field in the device layout of GuidingView.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "wavecomb/guiding/parallax_sphere.h"

namespace wavecomb {

/// Arrays of GuidingView, with the same names.
struct GuidingFieldArrays {
  std::vector<uint32_t> entries, cells, tables;
  std::vector<ParallaxSphere> spheres;
  std::vector<float> bsdf_share, material_share, survival;

  size_t bytes() const {
    return (entries.size() + cells.size() + tables.size()) * sizeof(uint32_t) +
           spheres.size() * sizeof(ParallaxSphere) +
           (bsdf_share.size() + material_share.size() + survival.size()) * sizeof(float);
  }
};

/// Validates arrays that come from a file, so that kernels neither read out of bounds nor divide by
/// zero. Throws Error unless they form a field with at least one region for a scene with this
/// number of materials.
void check_guiding_arrays(const GuidingFieldArrays& parts, size_t materials);

}  // namespace wavecomb
