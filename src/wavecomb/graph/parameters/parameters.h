// SPDX-License-Identifier: Apache-2.0
/// Material parameters that value graphs can drive, by component.
#pragma once

#include <cstdint>
#include <string_view>

#include "wavecomb/graph/graph.h"
#include "wavecomb/material/description/openpbr_inputs.h"

namespace wavecomb {

/// Parameter that a graph can drive. Graph values are clamped to [low, high]; NaN becomes `low`.
struct GraphParameter {
  const char* name;
  uint32_t components;
  float low, high;
};

/// Material parameters that graphs can drive. The textured inputs and ior come first, followed by
/// the additional inputs of the shading program "openpbr" in the order of OpenPbrRecord.
inline constexpr GraphParameter kGraphParameters[] = {{"base_color", 3, 0, 1},
                                                      {"specular_color", 3, 0, 1},
                                                      {"emission", 3, 0, 1e18f},
                                                      {"roughness", 1, 0, 1},
                                                      {"metallic", 1, 0, 1},
                                                      {"clearcoat", 1, 0, 1},
                                                      {"clearcoat_roughness", 1, 0, 1},
                                                      {"opacity", 1, 0, 1},
                                                      {"normal", 3, -1e6f, 1e6f},
                                                      {"ior", 1, 0.1f, 10},
#define WAVECOMB_PARAMETER(kind, name, standard, least, most) \
  {#name, sizeof(OpenPbrInputs<float>::kind) / 4, least, most},
                                                      WAVECOMB_OPENPBR_INPUTS(WAVECOMB_PARAMETER)
#undef WAVECOMB_PARAMETER
};

/// Returns the index of a parameter's first component, or the total number of components if the
/// name is unknown.
constexpr uint32_t graph_parameter(std::string_view name) {
  uint32_t first = 0;
  for (const GraphParameter& p : kGraphParameters) {
    if (name == p.name) return first;
    first += p.components;
  }
  return first;
}
inline constexpr uint32_t kGraphOutputCount = graph_parameter("");
/// Parameter components below this index are members of ShadingParams.
inline constexpr uint32_t kFirstOpenPbrOutput = graph_parameter("diffuse_roughness");
inline constexpr uint32_t kEmissionOutput = graph_parameter("emission");
inline constexpr uint32_t kOpacityOutput = graph_parameter("opacity");
inline constexpr uint32_t kNormalOutput = graph_parameter("normal");

/// Limits of each parameter component.
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
