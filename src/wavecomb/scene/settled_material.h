// SPDX-License-Identifier: Apache-2.0
/// Materials without the textures and graphs that say nothing.
#pragma once

#include <span>

#include "wavecomb/scene/material_data.h"
#include "wavecomb/texture/texture.h"

namespace wavecomb {

/// Between what the components of an input lie.
struct InputRange {
  Vec3<float> low, high;
};

/// Of what input `input` may read by `use`, brought to where kernels bring it; normals, which are
/// made unit, as they are read.
InputRange input_range(Input input, const TextureUse& use, const Texture& texture);

/// `material`, where inputs whose textures give the same value everywhere are that constant, and
/// likewise opacity and emission by graphs that can give one value only: it is shaded to the same
/// numbers, and reads fewer textures. A mesh whose material reads none is seen in another frame, so
/// that samples fall elsewhere.
Material settled(Material material, const GraphSet& graphs, std::span<const TexturePtr> textures);

}  // namespace wavecomb
