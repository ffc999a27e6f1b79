// SPDX-License-Identifier: Apache-2.0
/// Textures and value graphs with known value ranges, and the kernel variants that are selected for
/// their materials.
#pragma once

#include "graph_ops.h"
#include "wave_testing.h"
#include "wavecomb/graph/parameters/ranges.h"
#include "wavecomb/material/description/simplified_material.h"
#include "wavecomb/material/description/variants.h"

namespace wavecomb::range_testing {

using namespace scene_testing;

inline TextureUse& at(Material& m, Input s) {
  return m.textures[static_cast<size_t>(s)];
}
inline TexturePtr texture_of(const std::vector<float>& texels, uint32_t channels) {
  const auto width = static_cast<uint32_t>(texels.size() / channels);
  return std::make_shared<const Texture>(
      TextureDesc{"texture", texels.data(), width, 1, channels, TexelFormat::kF32, false, {}, {}});
}
inline TextureUse scaled_use(uint32_t texture, uint32_t channel, float scale, float bias) {
  TextureUse u = use(texture, channel);
  u.scale = {scale, scale, scale, scale};
  u.bias = {bias, bias, bias, bias};
  return u;
}
inline std::string variant_of(const Material& m, std::span<const TexturePtr> textures,
                              const GraphSet& graphs = {}) {
  const Material shaded = simplified(m, graphs, textures);
  return kVariants[cheapest_variant(m.program, parts_of(shaded, graphs, textures))].name;
}

/// Makes textures with these values: 0: constant 0. 1: constant 1. 2: 0 to 1. 3: -1 to -0.5. 4: 2
/// to 3, and NaN if `bad`. 5: colour (0.2, 0.4, 0.6). 6: 0.5 to 1, with one texel of 0.
inline std::vector<TexturePtr> make_textures(bool bad = false) {
  std::vector<float> large(16, 2.f);
  large[3] = 3.f;
  if (bad) large[5] = kNan;
  std::vector<float> ramp(16), negative(16, -1.f), half(16, 0.5f), colour;
  for (size_t i = 0; i < 16; ++i) ramp[i] = static_cast<float>(i) / 15.f;
  negative[4] = -0.5f;
  half[8] = 1.f;
  half[9] = 0.f;
  for (size_t i = 0; i < 16; ++i) colour.insert(colour.end(), {0.2f, 0.4f, 0.6f});
  return {texture_of(std::vector<float>(16, 0.f), 1),
          texture_of(std::vector<float>(16, 1.f), 1),
          texture_of(ramp, 1),
          texture_of(negative, 1),
          texture_of(large, 1),
          texture_of(colour, 3),
          texture_of(half, 1)};
}

inline constexpr uint16_t kConstant = kGraphConstant;

/// Makes a graph that drives all components of `parameter` by image `image`.
inline Graph image_graph(const char* parameter, uint32_t image) {
  Graph g;
  g.ops = {op(GraphCode::kInput, 2, 0, {}, 0, static_cast<uint16_t>(GraphInput::kUv)),
           op(GraphCode::kImage, 4, 2, {0}, 1)};
  g.images = {{image, 1.f}};
  const uint32_t count = output(parameter) == kEmissionOutput ? 3 : 1;
  for (uint16_t c = 0; c < count; ++c)
    g.outputs.push_back(
        {static_cast<uint16_t>(output(parameter) + c), static_cast<uint16_t>(2 + c)});
  return g;
}

}  // namespace wavecomb::range_testing
