// SPDX-License-Identifier: Apache-2.0
/// Hand-written operations of value graphs.
#pragma once

#include <algorithm>
#include <initializer_list>

#include "wavecomb/graph/graph.h"
#include "wavecomb/graph/parameters/parameters.h"

namespace wavecomb {

inline GraphOp op(GraphCode code, uint8_t width, uint16_t to, std::initializer_list<uint16_t> from,
                  uint8_t steps = 0, uint16_t number = 0) {
  GraphOp o{};
  o.code = static_cast<uint8_t>(code);
  o.width = width;
  o.steps = steps;
  o.to = to;
  std::copy(from.begin(), from.end(), o.from);
  o.number = number;
  return o;
}

/// Returns the index of a material parameter, or of one of its components.
inline uint16_t output(const char* name, uint32_t component = 0) {
  return static_cast<uint16_t>(graph_parameter(name) + component);
}

}  // namespace wavecomb
