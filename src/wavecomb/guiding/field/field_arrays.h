// SPDX-License-Identifier: Apache-2.0
/// Arrays of a guiding field in the device layout of GuidingView.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "wavecomb/guiding/parallax_sphere.h"

namespace wavecomb {

/// Arrays to which GuidingView points.
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
/// zero. Throws Error unless the arrays form a field with at least one region for a scene with
/// `materials` materials.
void check_guiding_arrays(const GuidingFieldArrays& parts, size_t materials);

}  // namespace wavecomb
