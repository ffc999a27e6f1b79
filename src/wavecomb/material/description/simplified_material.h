// SPDX-License-Identifier: Apache-2.0
/// Simplification of materials whose textures and graphs are constant.
#pragma once

#include <span>

#include "wavecomb/material/description/material.h"
#include "wavecomb/texture/texture.h"

namespace wavecomb {

/// Range of values of a material input, for each component.
struct InputRange {
  Vec3<float> low, high;
};

/// Returns the range of values that `input` may read from `texture` with the channel, scale and
/// bias of `use`, clamped as in kernels. The range of a normal is not clamped, since kernels
/// normalize it instead.
InputRange input_range(Input input, const TextureUse& use, const Texture& texture);

/// Returns a simplified copy of `material`. Every texture with the same value at all texels, and
/// every opacity or emission graph with a single possible result, is replaced by a constant.
/// Shading results are identical, with fewer texture lookups. If no texture is left, shading uses a
/// different tangent frame, so that individual samples differ while their expectation stays the
/// same.
Material simplified(Material material, const GraphSet& graphs,
                    std::span<const TexturePtr> textures);

}  // namespace wavecomb
