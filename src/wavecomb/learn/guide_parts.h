// SPDX-License-Identifier: Apache-2.0
/// What a field that guides bounces is made of: the arrays that kernels read (GuideView).
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "wavecomb/learn/guide_sphere.h"

namespace wavecomb {

/// The arrays of GuideView, by its names.
struct GuideParts {
  std::vector<uint32_t> entries, cells, tables;
  std::vector<GuideSphere> spheres;
  std::vector<float> bsdf_share, material_share, survival;

  size_t bytes() const {
    return (entries.size() + cells.size() + tables.size()) * sizeof(uint32_t) +
           spheres.size() * sizeof(GuideSphere) +
           (bsdf_share.size() + material_share.size() + survival.size()) * sizeof(float);
  }
};

/// Throws Error unless they are those of a field with regions, of a scene with so many materials:
/// what comes out of a file must not have kernels read beyond an array, or divide by nothing.
void check_guide_parts(const GuideParts& parts, size_t materials);

}  // namespace wavecomb
