// SPDX-License-Identifier: Apache-2.0
/// Value graphs, which are flat programs with a small set of registers that compute material
/// parameters.
///
/// A register holds one float per SIMD lane. A vector of 2 to 4 components occupies consecutive
/// registers. Python compiles the shader networks of a stage to such programs
/// (wavecomb/usd/graphs/values.py); the C++ code in graph/ only runs the programs.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "wavecomb/texture/attribute_data.h"

namespace wavecomb {

/// Operations of value graphs. Unless noted otherwise, they work on each component separately. The
/// comments call the operands a, b and c. The order of the operations must match `graph_codes` in
/// the bindings.
enum class GraphCode : uint8_t {
  kCopy,   ///< component k of the result is operand k
  kInput,  ///< GraphInput `number`
  kImage,  ///< r, g, b and alpha of image `number` at texture coordinates a
  kAdd,
  kSubtract,
  kMultiply,
  kDivide,  ///< a / b, 0 if b is 0
  kModulo,  ///< a - b floor(a / b), 0 where b is 0
  kPower,   ///< a^b; 0 if a < 0 and b is not 0
  kMin,
  kMax,
  kAtan2,       ///< atan2(a, b), radians
  kLess,        ///< 1 if a < b, else 0
  kEqual,       ///< 1 if a = b, else 0
  kMix,         ///< a + (b - a) c
  kClamp,       ///< a clamped to [b, c]
  kSelect,      ///< b if a is not 0, else c
  kSmoothstep,  ///< smoothstep of a between b and c
  kAbs,
  kFloor,
  kSign,
  kSqrt,  ///< square root of max(a, 0)
  kExp,
  kLog,  ///< natural logarithm of max(a, 1.2e-38)
  kSin,
  kCos,
  kAcos,  ///< arc cosine of a clamped to [-1, 1]
  kDot,   ///< scalar product of vectors of `width` components
  kCross,
  kRgbToHsv,
  kHsvToRgb,
  kNoise2,  ///< gradient noise at point a, as `width` uncorrelated values
  kNoise3,
  kFractal3,  ///< fractal noise at point a with `number` octaves, frequency factor b and amplitude
              ///< factor c
  kCell2,     ///< cell noise at point a, as `width` values
  kCell3,
  /// Worley noise at point a with jitter b. The result is the `width` smallest distances or, if
  /// `number` is 1, the value of the nearest cell.
  kWorley2,
  kWorley3,
  /// Attribute `number` of the mesh, or operand a if the mesh has no such attribute with `width`
  /// components.
  kAttribute,
};
inline constexpr uint32_t kGraphCodeCount = 39;

/// Inputs that a hit provides to graphs.
enum class GraphInput : uint8_t {
  kUv,             ///< texture coordinates, with 2 components; all other inputs have 3
  kPosition,       ///< position in world space
  kLocalPosition,  ///< position in the space of the instanced group of meshes
  kNormal,         ///< unit shading normal in world space
  kLocalNormal,    ///< unit shading normal in the space of the instanced group
  kTangent,        ///< unit tangent along u in world space
  kBitangent,      ///< unit vector perpendicular to normal and tangent, towards increasing v
  kView,           ///< unit direction to the viewer in world space
  /// World-space images of the local axes under the normal transform. These are the rows of the
  /// inverse of the instance transform.
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
/// Bit of an operand index that is set if the index refers to a constant, and clear if it refers to
/// a register.
inline constexpr uint16_t kGraphConstant = 1u << 15;
inline constexpr uint32_t kNoGraph = 0xffffffffu;

/// One operation: 16 bytes.
struct GraphOp {
  uint8_t code;   ///< GraphCode
  uint8_t width;  ///< components, 1 to 4
  uint8_t steps;  ///< bit k is set if operand k is a vector, and clear if it is a scalar
  uint8_t pad = 0;
  /// First register to write; the written registers must not overlap registers that the operation
  /// reads.
  uint16_t to;
  uint16_t from[4];
  uint16_t number;
};
static_assert(sizeof(GraphOp) == 16);

/// Image that a program reads.
struct GraphImage {
  uint32_t texture;
  /// Factor that converts distances in mesh texture coordinates to distances in image coordinates.
  float stretch;
};

/// Output of a program: index of the parameter component that the output drives, and operand that
/// holds the value.
struct GraphOutput {
  uint16_t parameter, from;
};

/// Graph program that has not been added to a GraphSet yet.
struct Graph {
  std::vector<GraphOp> ops;
  std::vector<float> constants;
  std::vector<GraphImage> images;
  std::vector<GraphOutput> outputs;
  /// Names of the attributes that kAttribute operations read by index.
  std::vector<std::string> attributes;
  /// Returns whether an output drives any of the `count` parameter components that start at index
  /// `first`.
  bool drives(uint32_t first, uint32_t count = 1) const {
    for (const GraphOutput& o : outputs)
      if (o.parameter >= first && o.parameter < first + count) return true;
    return false;
  }
};

/// Index ranges of a program in the arrays of GraphSet.
struct GraphProgram {
  uint32_t first_op, op_count, first_constant, first_image, first_output, output_count;
};

/// Read-only view of all programs for kernels.
struct GraphView {
  const GraphProgram* programs = nullptr;
  const GraphOp* ops = nullptr;
  const float* constants = nullptr;
  const GraphImage* images = nullptr;
  const GraphOutput* outputs = nullptr;
  uint32_t inputs = 0;  ///< bits (graph_input_bit) of all inputs that any program reads
  AttributeView attributes{};
};

/// All programs of a scene in packed arrays.
struct GraphSet {
  std::vector<GraphProgram> programs;
  std::vector<GraphOp> ops;
  std::vector<float> constants;
  std::vector<GraphImage> images;
  std::vector<GraphOutput> outputs;
  uint32_t inputs = 0;

  /// Adds a program that passed check_graph(). The program's attribute operations must use the
  /// attribute ids of the scene.
  void add(const Graph& graph);
  /// Returns whether program `graph`, which may be kNoGraph, drives component `parameter`.
  bool drives(uint32_t graph, uint32_t parameter) const;
  /// Returns whether program `graph`, which may be kNoGraph, reads any of the inputs in `bits`, a
  /// combination of graph_input_bit() values.
  bool reads(uint32_t graph, uint32_t bits) const;
  GraphView view() const {
    if (programs.empty()) return {};
    return {programs.data(), ops.data(), constants.data(), images.data(), outputs.data(),
            inputs,          {}};
  }
};

/// Returns the inputs that a program reads, as bits of graph_input_bit.
uint32_t graph_inputs(const Graph& graph);

/// Throws Error if a program reads or writes out of range. `name` is the owner of the graph, for
/// error messages. `parameters` is the number of parameter components that outputs may drive.
void check_graph(const Graph& graph, const std::string& name, size_t texture_count,
                 uint32_t parameters);

}  // namespace wavecomb
