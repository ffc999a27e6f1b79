// SPDX-License-Identifier: Apache-2.0
/// What a value graph can drive: parameters of programs, component by component.
#pragma once

#include <cstdint>
#include <string_view>

#include "wavecomb/texture/graph_data.h"

namespace wavecomb {

/// One parameter. Values of graphs are brought to [low, high], NaN to `low`.
struct GraphParameter {
  const char* name;
  uint32_t components;
  float low, high;
};

/// Slots and ior first, then what program "openpbr" has beside them, as OpenPbrRecord has it.
inline constexpr GraphParameter kGraphParameters[] = {
    {"base_color", 3, 0, 1},
    {"specular_color", 3, 0, 1},
    {"emission", 3, 0, 1e18f},
    {"roughness", 1, 0, 1},
    {"metallic", 1, 0, 1},
    {"clearcoat", 1, 0, 1},
    {"clearcoat_roughness", 1, 0, 1},
    {"opacity", 1, 0, 1},
    {"normal", 3, -1e6f, 1e6f},
    {"ior", 1, 0.1f, 10},
    {"diffuse_roughness", 1, 0, 1},
    {"specular_weight", 1, 0, 100},
    {"anisotropy", 1, 0, 1},
    {"rotation", 1, 0, 1},
    {"transmission_weight", 1, 0, 1},
    {"transmission_tint", 3, 0, 1},
    {"extinction", 3, 0, 1e6f},
    {"subsurface_weight", 1, 0, 1},
    {"subsurface_color", 3, 0, 1},
    {"subsurface_anisotropy", 1, -1, 1},
    {"fuzz_weight", 1, 0, 1},
    {"fuzz_color", 3, 0, 1},
    {"fuzz_roughness", 1, 0, 1},
    {"coat_color", 3, 0, 1},
    {"coat_ior", 1, 0.1f, 10},
    {"coat_darkening", 1, 0, 1},
    {"film_weight", 1, 0, 1},
    {"film_thickness", 1, 0, 1e5f},
    {"film_ior", 1, 1, 10},
};

/// Number of the first component of a parameter; of the one after all for an unknown name.
constexpr uint32_t graph_parameter(std::string_view name) {
  uint32_t first = 0;
  for (const GraphParameter& p : kGraphParameters) {
    if (name == p.name) return first;
    first += p.components;
  }
  return first;
}
inline constexpr uint32_t kGraphOutputCount = graph_parameter("");
/// Components before this one are of ShadingParams.
inline constexpr uint32_t kFirstOpenPbrOutput = graph_parameter("diffuse_roughness");
inline constexpr uint32_t kEmissionOutput = graph_parameter("emission");
inline constexpr uint32_t kOpacityOutput = graph_parameter("opacity");
inline constexpr uint32_t kNormalOutput = graph_parameter("normal");

/// Limits of each component.
struct GraphRanges {
  float low[kGraphOutputCount], high[kGraphOutputCount];
  constexpr GraphRanges() : low{}, high{} {
    uint32_t at = 0;
    for (const GraphParameter& p : kGraphParameters)
      for (uint32_t i = 0; i < p.components; ++i, ++at) {
        low[at] = p.low;
        high[at] = p.high;
      }
  }
};
inline constexpr GraphRanges kGraphRanges;

}  // namespace wavecomb
