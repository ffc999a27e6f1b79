// SPDX-License-Identifier: Apache-2.0
/// Bindings of SceneBuilder for textures and materials.
#include <nanobind/ndarray.h>
#include <nanobind/stl/array.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/pair.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/tuple.h>
#include <nanobind/stl/vector.h>

#include <algorithm>
#include <array>

#include "arguments.h"
#include "bind.h"
#include "scene_values.h"
#include "wavecomb/scene/scene.h"

namespace nb = nanobind;
using namespace wavecomb;

namespace {

Wrap wrap(const std::string& name) {
  return choose<Wrap>("wrap", name,
                      {{"repeat", Wrap::kRepeat},
                       {"clamp", Wrap::kClamp},
                       {"mirror", Wrap::kMirror},
                       {"black", Wrap::kBlack}});
}

template <size_t N>
void fill(std::array<float, N>& to, const nb::handle& from, const char* what) {
  const auto values = nb::cast<std::vector<float>>(from);
  if (values.size() != N)
    throw Error(std::string(what) + " must have " + std::to_string(N) + " numbers");
  std::copy(values.begin(), values.end(), to.begin());
}

}  // namespace

TextureUse texture_use(const nb::dict& d) {
  TextureUse use;
  use.texture = nb::cast<uint32_t>(d["texture"]);
  if (d.contains("channel"))
    use.channel = choose<uint32_t>("channel", nb::cast<std::string>(d["channel"]),
                                   {{"r", 0u}, {"g", 1u}, {"b", 2u}, {"a", 3u}, {"rgb", 4u}});
  if (d.contains("scale")) fill(use.scale, d["scale"], "scale");
  if (d.contains("bias")) fill(use.bias, d["bias"], "bias");
  if (d.contains("uv")) fill(use.uv, d["uv"], "uv");
  return use;
}

namespace {

/// Converts a name to the enum value whose index is the name's position in `names`. Throws an
/// `Error` whose message begins with `what` if the name is unknown.
template <typename Enum, size_t N>
Enum named(const char* what, const char* const (&names)[N], const std::string& name) {
  for (uint32_t i = 0; i < N; ++i)
    if (name == names[i]) return static_cast<Enum>(i);
  throw Error(std::string(what) + " '" + name + "' is not known; it must be one of " +
              listed(names));
}

uint32_t add_texture(SceneBuilder& builder,
                     const nb::ndarray<nb::c_contig, nb::device::cpu, nb::ro>& pixels, bool srgb,
                     const std::string& wrap_s, const std::string& wrap_t,
                     const std::string& name) {
  TextureDesc desc;
  desc.name = name;
  if (pixels.ndim() != 2 && pixels.ndim() != 3)
    throw Error("texture '" + name + "' must be an array of (height, width, channels)");
  if (pixels.dtype() == nb::dtype<uint8_t>())
    desc.format = TexelFormat::kU8;
  else if (pixels.dtype() == nb::dtype<float>())
    desc.format = TexelFormat::kF32;
  else if (pixels.dtype().code == static_cast<uint8_t>(nb::dlpack::dtype_code::Float) &&
           pixels.dtype().bits == 16)
    desc.format = TexelFormat::kF16;
  else
    throw Error("texture '" + name + "' must be of uint8, float16 or float32");
  const auto size = [&](size_t i) {
    return static_cast<uint32_t>(std::min<size_t>(pixels.shape(i), 1u << 30));
  };
  desc.data = pixels.data();
  desc.height = size(0);
  desc.width = size(1);
  desc.channels = pixels.ndim() == 3 ? size(2) : 1;
  desc.srgb = srgb;
  desc.wrap_s = wrap(wrap_s);
  desc.wrap_t = wrap(wrap_t);
  // Other Python threads can run while the texture is converted.
  const nb::gil_scoped_release release;
  return builder.add_texture(desc);
}

uint32_t share_texture(SceneBuilder& builder, const Scene& scene, uint32_t texture) {
  const auto& textures = scene.textures();
  if (texture >= textures.size())
    throw Error("texture " + std::to_string(texture) + " is not in a scene of " +
                std::to_string(textures.size()) + " textures");
  return builder.add_texture(textures[texture]);
}

uint32_t add_material(SceneBuilder& builder, const std::string& program_name,
                      const std::string& name, const nb::dict& openpbr, const nb::dict& textures,
                      std::optional<uint32_t> graph, std::optional<uint32_t> opacity_graph,
                      std::optional<uint32_t> emission_graph, const nb::kwargs& values) {
  Material m;
  m.name = name;
  m.program = named<ProgramId>("program", kProgramNames, program_name);
  read_parameters(m, values);
  m.openpbr = openpbr_of(name, openpbr);
  m.graph = graph.value_or(kNoGraph);
  m.opacity_graph = opacity_graph.value_or(kNoGraph);
  m.emission_graph = emission_graph.value_or(kNoGraph);
  for (const auto& [key, value] : textures)
    m.textures[named<size_t>("textured input", kInputNames, nb::cast<std::string>(key))] =
        texture_use(nb::cast<nb::dict>(value));
  return builder.add_material(std::move(m));
}

}  // namespace

void def_materials(nb::class_<SceneBuilder>& builder) {
  using namespace nb::literals;
  builder
      .def("add_texture", &add_texture, "pixels"_a, nb::kw_only(), "srgb"_a, "wrap_s"_a = "repeat",
           "wrap_t"_a = "repeat", "name"_a = "")
      .def("share_texture", &share_texture, "scene"_a, "texture"_a)
      .def("add_tiles", &SceneBuilder::add_tiles, "name"_a, "tiles"_a, "missing"_a)
      .def("add_graph", &add_graph, "ops"_a, "constants"_a, "images"_a, "outputs"_a,
           "attributes"_a = std::vector<std::string>())
      .def("add_material", &add_material, "program"_a, nb::kw_only(), "name"_a = "",
           "openpbr"_a = nb::dict(), "textures"_a = nb::dict(), "graph"_a = nb::none(),
           "opacity_graph"_a = nb::none(), "emission_graph"_a = nb::none(), "values"_a);
}
