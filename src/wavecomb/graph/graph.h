// SPDX-License-Identifier: Apache-2.0
/// Value graphs as data: flat programs over a small file of registers.
///
/// A register holds one float for each lane; a vector of 2 to 4 components is as many neighbours.
/// Python compiles the node networks of a stage to programs (wavecomb/usd/graphs/expressions.py);
/// here they are only run.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "wavecomb/texture/attribute_data.h"

namespace wavecomb {

/// What an operation does, component by component unless it says otherwise. a, b and c are its
/// operands. The order is that of `graph_codes` in the bindings.
enum class GraphCode : uint8_t {
  kCopy,   ///< component k is operand k
  kInput,  ///< of GraphInput `number`
  kImage,  ///< image `number` at a: r, g, b, alpha
  kAdd,
  kSubtract,
  kMultiply,
  kDivide,  ///< 0 where b is 0
  kModulo,  ///< a - b floor(a / b), 0 where b is 0
  kPower,   ///< 0 where a < 0
  kMin,
  kMax,
  kAtan2,  ///< of a / b
  kLess,   ///< 1 where a < b, else 0
  kEqual,
  kMix,         ///< a + (b - a) c
  kClamp,       ///< of a to [b, c]
  kSelect,      ///< b where a is not 0, else c
  kSmoothstep,  ///< of a, from b to c
  kAbs,
  kFloor,
  kSign,
  kSqrt,  ///< of max(a, 0)
  kExp,
  kLog,  ///< of max(a, 1.2e-38)
  kSin,
  kCos,
  kAcos,  ///< of a clamped to [-1, 1]
  kDot,   ///< one number, of vectors of `width` components
  kCross,
  kRgbToHsv,
  kHsvToRgb,
  kNoise2,  ///< at a, `width` values that are not alike
  kNoise3,
  kFractal3,  ///< at a; `number` octaves, lacunarity b, diminish c
  kCell2,     ///< `width` values
  kCell3,
  kWorley2,  ///< at a, jitter b: distances to the nearest `width` points; the cell's number if
             ///< `number` is 1
  kWorley3,
  kAttribute,  ///< attribute `number` of the mesh; a where it has none of `width` components
};
inline constexpr uint32_t kGraphCodeCount = 39;

/// What the surface tells a graph.
enum class GraphInput : uint8_t {
  kUv,             ///< 2
  kPosition,       ///< 3, in the world
  kLocalPosition,  ///< in the space of the group of meshes that is instanced
  kNormal,         ///< unit shading normal in the world
  kLocalNormal,
  kTangent,    ///< unit, along u in the world
  kBitangent,  ///< unit, along v as far as that is across the tangent
  kView,       ///< unit, to the viewer in the world
  /// In the world, what the axes of the group's space are to normals: rows of the inverse of its
  /// map.
  kNormalX,
  kNormalY,
  kNormalZ,
};
inline constexpr uint32_t kGraphInputCount = 11;
inline constexpr uint32_t graph_input_bit(GraphInput i) {
  return 1u << static_cast<uint32_t>(i);
}

inline constexpr uint32_t kMaxGraphRegisters = 128;
inline constexpr uint32_t kMaxGraphOps = 4096;
/// An operand with this bit is a constant of the program, else a register.
inline constexpr uint16_t kGraphConstant = 1u << 15;
inline constexpr uint32_t kNoGraph = 0xffffffffu;

/// One operation: 16 bytes.
struct GraphOp {
  uint8_t code;   ///< GraphCode
  uint8_t width;  ///< components, 1 to 4
  uint8_t steps;  ///< bit k: operand k is a vector; else one number for all components
  uint8_t pad = 0;
  uint16_t to;  ///< first register that it writes, none that it reads
  uint16_t from[4];
  uint16_t number;
};
static_assert(sizeof(GraphOp) == 16);

/// An image that a program reads.
struct GraphImage {
  uint32_t texture;
  float stretch;  ///< lengths in its coordinates for one in those of the mesh
};

/// A result: what it drives, and the operand that holds it.
struct GraphOutput {
  uint16_t parameter, from;
};

/// One program as it is made.
struct Graph {
  std::vector<GraphOp> ops;
  std::vector<float> constants;
  std::vector<GraphImage> images;
  std::vector<GraphOutput> outputs;
  std::vector<std::string> attributes;  ///< names of those that operations number
  bool drives(uint32_t first, uint32_t count = 1) const {
    for (const GraphOutput& o : outputs)
      if (o.parameter >= first && o.parameter < first + count) return true;
    return false;
  }
};

/// Where a program is in the arrays of all.
struct GraphProgram {
  uint32_t first_op, op_count, first_constant, first_image, first_output, output_count;
};

/// What kernels need of all programs.
struct GraphView {
  const GraphProgram* programs = nullptr;
  const GraphOp* ops = nullptr;
  const float* constants = nullptr;
  const GraphImage* images = nullptr;
  const GraphOutput* outputs = nullptr;
  uint32_t inputs = 0;  ///< graph_input_bit of what any program reads
  AttributeView attributes{};
};

/// All programs of a scene, in arrays that lanes read.
struct GraphSet {
  std::vector<GraphProgram> programs;
  std::vector<GraphOp> ops;
  std::vector<float> constants;
  std::vector<GraphImage> images;
  std::vector<GraphOutput> outputs;
  uint32_t inputs = 0;

  /// Adds a program that check_graph found good, with the scene's numbers of attributes.
  void add(const Graph& graph);
  /// Whether program `graph` (kNoGraph: none) drives component `parameter`.
  bool drives(uint32_t graph, uint32_t parameter) const;
  /// Whether program `graph` (kNoGraph: none) reads an input of `bits` (graph_input_bit).
  bool reads(uint32_t graph, uint32_t bits) const;
  GraphView view() const {
    if (programs.empty()) return {};
    return {programs.data(), ops.data(), constants.data(), images.data(), outputs.data(),
            inputs,          {}};
  }
};

/// Inputs that a program reads, as bits of graph_input_bit.
uint32_t graph_inputs(const Graph& graph);

/// Throws Error where a program would read or write what is not there. `name` is of what it belongs
/// to, `parameters` is how many an output may name.
void check_graph(const Graph& graph, const std::string& name, size_t texture_count,
                 uint32_t parameters);

}  // namespace wavecomb
