// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/material/description/simplified_material.h"

#include <algorithm>

#include "wavecomb/core/lanes/lanes.h"
#include "wavecomb/graph/parameters/parameters.h"
#include "wavecomb/graph/parameters/ranges.h"

namespace wavecomb {
namespace {

void put(Material& m, Input input, const Vec3<float>& value) {
  switch (input) {
    case Input::kBaseColor:
      m.base_color = value;
      return;
    case Input::kSpecularColor:
      m.specular_color = value;
      return;
    case Input::kEmission:
      m.emission = value;
      return;
    case Input::kRoughness:
      m.roughness = value.x;
      return;
    case Input::kMetallic:
      m.metallic = value.x;
      return;
    case Input::kClearcoat:
      m.clearcoat = value.x;
      return;
    case Input::kClearcoatRoughness:
      m.clearcoat_roughness = value.x;
      return;
    case Input::kOpacity:
      m.opacity = value.x;
      return;
    case Input::kNormal:
      return;
  }
}

bool is_color(Input input) {
  return input == Input::kBaseColor || input == Input::kSpecularColor || input == Input::kEmission;
}

/// Returns the constant value that a graph gives to a material input, or an empty value if the
/// graph can give different values at different hits. The input has `count` components, which start
/// at `first` in GraphParameter.
std::optional<Vec3<float>> only_value(const DrivenRanges& ranges, uint32_t first, uint32_t count) {
  float value[3] = {0, 0, 0};
  for (uint32_t c = 0; c < count; ++c) {
    const auto& range = ranges[first + c];
    if (!range || range->low != range->high) return std::nullopt;
    value[c] = range->low;
  }
  return Vec3<float>(value[0], value[1], value[2]);
}

}  // namespace

InputRange input_range(Input input, const TextureUse& use, const Texture& texture) {
  const TexelRange& texels = texture.range();
  const uint32_t first = graph_parameter(kInputNames[static_cast<size_t>(input)]);
  float low[3], high[3];
  for (uint32_t c = 0; c < 3; ++c) {
    const uint32_t from = use.channel < 4 ? use.channel : c;
    // Kernels compute the input with the same fused multiply-add. Its rounding is monotonic, so the
    // results for the smallest and the largest texel are bounds for all texels.
    const auto at = [&](float texel) { return fma(texel, use.scale[from], use.bias[from]); };
    const auto [least, most] = std::minmax({at(texels.low[from]), at(texels.high[from])});
    const uint32_t component = first + (is_color(input) || input == Input::kNormal ? c : 0);
    const auto clamp_to_range = [&](float x) {
      return clamp(x, kGraphRanges.low[component], kGraphRanges.high[component]);
    };
    const bool is_normal = input == Input::kNormal;
    low[c] = is_normal ? least : clamp_to_range(least);
    high[c] = is_normal ? most : clamp_to_range(most);
  }
  return {{low[0], low[1], low[2]}, {high[0], high[1], high[2]}};
}

Material simplified(Material m, const GraphSet& graphs, std::span<const TexturePtr> textures) {
  const auto fix = [&](Input input, const Vec3<float>& value) {
    put(m, input, value);
    m.textures[static_cast<size_t>(input)] = TextureUse{};
  };
  for (uint32_t s = 0; s < kInputCount; ++s) {
    const auto input = static_cast<Input>(s);
    const TextureUse& use = m.textures[s];
    // Keep a constant normal map, since a material without a normal map is shaded with a different
    // tangent frame.
    if (use.texture >= textures.size() || input == Input::kNormal) continue;
    const auto [low, high] = input_range(input, use, *textures[use.texture]);
    const bool same = low.x == high.x && (!is_color(input) || (low.y == high.y && low.z == high.z));
    if (same) fix(input, low);
  }
  // Replaces a graph that only traversal and light sampling evaluate. Shading still runs the
  // complete graph.
  const auto simplify = [&](uint32_t& graph, Input input, uint32_t first, uint32_t count) {
    const auto value = only_value(driven_ranges(graphs, graph, textures), first, count);
    if (!value) return;
    fix(input, *value);
    graph = kNoGraph;
  };
  simplify(m.opacity_graph, Input::kOpacity, kOpacityOutput, 1);
  simplify(m.emission_graph, Input::kEmission, kEmissionOutput, 3);
  return m;
}

}  // namespace wavecomb
