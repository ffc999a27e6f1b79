// SPDX-License-Identifier: Apache-2.0
/// Bindings of value graphs: lists of the operations, inputs and material parameters by name, and
/// evaluation of a graph at given points.
#include <nanobind/ndarray.h>
#include <nanobind/stl/pair.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

#include <algorithm>
#include <array>
#include <cstring>

#include "bind.h"
#include "wavecomb/core/error.h"
#include "wavecomb/graph/parameters/parameters.h"
#include "wavecomb/graph/run.inl"
#include "wavecomb/texture/lookup.inl"

namespace nb = nanobind;
using namespace nb::literals;
using namespace wavecomb;

namespace {

using Pairs = std::vector<std::pair<uint32_t, uint32_t>>;
using Images = std::vector<std::pair<uint32_t, float>>;
using Names = std::vector<std::string>;

constexpr std::array<const char*, kGraphCodeCount> kCodes{
    "copy",   "input",      "image", "add",   "subtract", "multiply", "divide",   "modulo",
    "power",  "min",        "max",   "atan2", "less",     "equal",    "mix",      "clamp",
    "select", "smoothstep", "abs",   "floor", "sign",     "sqrt",     "exp",      "log",
    "sin",    "cos",        "acos",  "dot",   "cross",    "rgbtohsv", "hsvtorgb", "noise2",
    "noise3", "fractal3",   "cell2", "cell3", "worley2",  "worley3",  "attribute"};
constexpr std::array<const char*, kGraphInputCount> kInputs{
    "uv",        "position", "local_position", "normal",   "local_normal", "tangent",
    "bitangent", "view",     "normal_x",       "normal_y", "normal_z"};

Graph make_graph(const nb::bytes& ops, const std::vector<float>& constants, const Images& images,
                 const Pairs& outputs, const Names& attributes) {
  Graph graph;
  graph.attributes = attributes;
  if (ops.size() % sizeof(GraphOp) != 0) throw Error("a graph has an incomplete operation");
  graph.ops.resize(ops.size() / sizeof(GraphOp));
  if (ops.size() > 0) std::memcpy(graph.ops.data(), ops.c_str(), ops.size());
  graph.constants = constants;
  for (const auto& [texture, stretch] : images) graph.images.push_back({texture, stretch});
  for (const auto& [parameter, from] : outputs)
    graph.outputs.push_back({static_cast<uint16_t>(parameter), static_cast<uint16_t>(from)});
  return graph;
}

using Points = nb::ndarray<const float, nb::shape<-1, 30>, nb::c_contig, nb::device::cpu>;

/// Evaluates a compiled value graph at points, in packets of type `F`. Repeats the last point to
/// fill the last packet.
template <typename F>
void run(const GraphSet& set, const TextureView* textures, const Points& points, float* out) {
  const GraphView view = set.view();
  const GraphProgram& program = view.programs[0];
  const size_t count = points.shape(0), width = kWidth<F>;
  F registers[kMaxGraphRegisters];
  for (size_t i = 0; i < count; i += width) {
    const auto column = [&](size_t c) {
      alignas(64) float lanes[kWidth<F>];
      for (size_t k = 0; k < width; ++k)
        lanes[k] = points.data()[std::min(i + k, count - 1) * points.shape(1) + c];
      return wavecomb::load<F>(lanes);
    };
    const auto vec3 = [&](size_t c) { return Vec3<F>(column(c), column(c + 1), column(c + 2)); };
    const GraphPoint<F> at{{column(0), column(1)},
                           column(2),
                           vec3(3),
                           vec3(6),
                           vec3(9),
                           vec3(12),
                           vec3(15),
                           F(1.f),
                           vec3(18),
                           vec3(21),
                           vec3(24),
                           vec3(27),
                           {}};
    run_graph<F>(view, program, textures, at, first_lanes<F>(count - i), registers);
    for (size_t o = 0; o < program.output_count; ++o) {
      alignas(64) float lanes[kWidth<F>];
      wavecomb::store(lanes, graph_output<F>(view, program, view.outputs[o], registers));
      for (size_t k = 0; k < width && i + k < count; ++k)
        out[(i + k) * program.output_count + o] = lanes[k];
    }
  }
}

nb::ndarray<nb::numpy, float, nb::ndim<2>> run_points(const nb::bytes& ops,
                                                      const std::vector<float>& constants,
                                                      const Images& images, const Pairs& outputs,
                                                      const Names& attributes, const Points& points,
                                                      uint32_t lanes) {
  Graph graph = make_graph(ops, constants, images, outputs, attributes);
  // Replace all images of the graph by a texture of one white texel.
  for (GraphImage& image : graph.images) image.texture = 0;
  check_graph(graph, "a graph to run", 1, ~uint32_t{0});
  GraphSet set;
  set.add(graph);
  const uint8_t white[4] = {255, 255, 255, 255};
  TextureDesc desc;
  desc.name = "white";
  desc.data = white;
  desc.width = desc.height = 1;
  desc.channels = 4;
  desc.format = TexelFormat::kU8;
  const Texture texture(desc);
  const size_t columns = graph.outputs.size();
  auto* out = new float[points.shape(0) * columns];
  const nb::capsule owner(out, [](void* p) noexcept { delete[] static_cast<float*>(p); });
  if (lanes == 1)
    run<float>(set, &texture.view(), points, out);
  else if (lanes == 16)
    run<FloatP<16>>(set, &texture.view(), points, out);
  else
    throw Error("lanes of a graph must be 1 or 16");
  return {out, {points.shape(0), columns}, owner};
}

}  // namespace

void bind_graphs(nb::module_& m) {
  nb::list codes, inputs;
  for (const char* name : kCodes) codes.append(name);
  for (const char* name : kInputs) inputs.append(name);
  nb::dict parameters;
  for (const GraphParameter& p : kGraphParameters)
    parameters[p.name] = nb::make_tuple(graph_parameter(p.name), p.components);
  m.attr("GRAPH_CODES") = nb::tuple(codes);
  m.attr("GRAPH_INPUTS") = nb::tuple(inputs);
  m.attr("GRAPH_PARAMETERS") = parameters;
  m.attr("GRAPH_REGISTERS") = kMaxGraphRegisters;
  m.attr("GRAPH_OPS") = kMaxGraphOps;
  m.attr("GRAPH_CONSTANT") = uint32_t{kGraphConstant};
  m.def("run_graph", &run_points, "ops"_a, "constants"_a, "images"_a, "outputs"_a, "attributes"_a,
        "points"_a, "lanes"_a = 1);
}

uint32_t add_graph(SceneBuilder& builder, const nb::bytes& ops, const std::vector<float>& constants,
                   const Images& images, const Pairs& outputs, const Names& attributes) {
  return builder.add_graph(make_graph(ops, constants, images, outputs, attributes));
}
