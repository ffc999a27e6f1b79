// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/graph/graph.h"

#include <algorithm>

#include <array>

#include "wavecomb/core/error.h"

namespace wavecomb {
namespace {

/// Properties of an operation: number of operands, number of components read from operand 0, and
/// number of results.
struct Shape {
  uint32_t operands, first_width, results;
};

Shape shape_of(const GraphOp& op) {
  const uint32_t w = op.width;
  switch (static_cast<GraphCode>(op.code)) {
    case GraphCode::kCopy:
      return {w, 1, w};
    case GraphCode::kInput:
      return {0, 0, w};
    case GraphCode::kImage:
    case GraphCode::kNoise2:
    case GraphCode::kCell2:
      return {1, 2, w};
    case GraphCode::kNoise3:
    case GraphCode::kCell3:
      return {1, 3, w};
    case GraphCode::kFractal3:
      return {3, 3, w};
    case GraphCode::kWorley2:
      return {2, 2, w};
    case GraphCode::kWorley3:
      return {2, 3, w};
    case GraphCode::kDot:
      return {2, w, 1};
    case GraphCode::kCross:
      return {2, w, w};
    case GraphCode::kMix:
    case GraphCode::kClamp:
    case GraphCode::kSelect:
    case GraphCode::kSmoothstep:
      return {3, w, w};
    case GraphCode::kAdd:
    case GraphCode::kSubtract:
    case GraphCode::kMultiply:
    case GraphCode::kDivide:
    case GraphCode::kModulo:
    case GraphCode::kPower:
    case GraphCode::kMin:
    case GraphCode::kMax:
    case GraphCode::kAtan2:
    case GraphCode::kLess:
    case GraphCode::kEqual:
      return {2, w, w};
    default:
      return {1, w, w};
  }
}

/// Returns the smallest vector width that an operation allows.
uint32_t min_width(GraphCode code) {
  const bool three =
      code == GraphCode::kCross || code == GraphCode::kRgbToHsv || code == GraphCode::kHsvToRgb;
  return three ? 3 : 1;
}

constexpr std::array<uint32_t, kGraphInputCount> kInputWidths{2, 3, 3, 3, 3, 3, 3, 3, 3, 3, 3};
constexpr uint32_t kMaxOctaves = 32;

}  // namespace

bool GraphSet::drives(uint32_t graph, uint32_t parameter) const {
  if (graph == kNoGraph) return false;
  const GraphProgram& p = programs[graph];
  const auto first = outputs.begin() + p.first_output;
  return std::any_of(first, first + p.output_count,
                     [&](const GraphOutput& o) { return o.parameter == parameter; });
}

bool GraphSet::reads(uint32_t graph, uint32_t bits) const {
  if (graph == kNoGraph) return false;
  const auto first = ops.begin() + programs[graph].first_op;
  return std::any_of(first, first + programs[graph].op_count, [&](const GraphOp& op) {
    return static_cast<GraphCode>(op.code) == GraphCode::kInput && (bits >> op.number & 1u) != 0;
  });
}

void GraphSet::add(const Graph& graph) {
  programs.push_back({static_cast<uint32_t>(ops.size()), static_cast<uint32_t>(graph.ops.size()),
                      static_cast<uint32_t>(constants.size()), static_cast<uint32_t>(images.size()),
                      static_cast<uint32_t>(outputs.size()),
                      static_cast<uint32_t>(graph.outputs.size())});
  ops.insert(ops.end(), graph.ops.begin(), graph.ops.end());
  constants.insert(constants.end(), graph.constants.begin(), graph.constants.end());
  images.insert(images.end(), graph.images.begin(), graph.images.end());
  outputs.insert(outputs.end(), graph.outputs.begin(), graph.outputs.end());
  inputs |= graph_inputs(graph);
}

uint32_t graph_inputs(const Graph& graph) {
  uint32_t bits = 0;
  for (const GraphOp& op : graph.ops)
    if (static_cast<GraphCode>(op.code) == GraphCode::kInput) bits |= 1u << op.number;
  return bits;
}

void check_graph(const Graph& graph, const std::string& name, size_t texture_count,
                 uint32_t parameters) {
  const auto require = [&](bool valid, const char* what) {
    if (!valid) throw Error(name + " has a graph with " + what + "; compile it again");
  };
  require(graph.ops.size() <= kMaxGraphOps, "too many operations");
  require(graph.constants.size() < kGraphConstant, "too many constants");
  std::array<bool, kMaxGraphRegisters> written{};
  const auto readable = [&](uint32_t from, uint32_t width) {
    if ((from & kGraphConstant) != 0)
      return (from & ~uint32_t{kGraphConstant}) + width <= graph.constants.size();
    bool valid = from + width <= kMaxGraphRegisters;
    for (uint32_t i = from; valid && i < from + width; ++i) valid = written[i];
    return valid;
  };
  for (const GraphOp& op : graph.ops) {
    require(op.code < kGraphCodeCount, "an unknown operation");
    const auto code = static_cast<GraphCode>(op.code);
    require(op.width >= min_width(code) && op.width <= (min_width(code) == 3 ? 3 : 4),
            "a vector of a wrong size");
    const Shape shape = shape_of(op);
    for (uint32_t k = 0; k < shape.operands; ++k) {
      const bool steps = (op.steps >> k & 1) != 0;
      const uint32_t width = k == 0 ? shape.first_width : uint32_t{op.width};
      const uint32_t read = code != GraphCode::kCopy && steps ? width : 1;
      require(readable(op.from[k], read), "an operand that does not exist");
      require(op.from[k] + read <= op.to || op.to + shape.results <= op.from[k],
              "a result that overwrites its operand");
    }
    if (code == GraphCode::kInput)
      require(op.number < kGraphInputCount && op.width <= kInputWidths[op.number],
              "an unknown input");
    if (code == GraphCode::kImage)
      require(op.number < graph.images.size() && graph.images[op.number].texture < texture_count,
              "an image that was never added");
    if (code == GraphCode::kAttribute)
      require(op.number < graph.attributes.size(), "an attribute without a name");
    if (code == GraphCode::kFractal3) require(op.number <= kMaxOctaves, "too many octaves");
    if (code == GraphCode::kWorley2 || code == GraphCode::kWorley3)
      require(op.width <= 3, "a vector of a wrong size");
    require(op.to + shape.results <= kMaxGraphRegisters, "too many values at once");
    for (uint32_t i = 0; i < shape.results; ++i) written[op.to + i] = true;
  }
  for (const GraphOutput& o : graph.outputs) {
    require(o.parameter < parameters, "an output that drives no parameter");
    require(readable(o.from, 1), "an output that does not exist");
  }
}

}  // namespace wavecomb
