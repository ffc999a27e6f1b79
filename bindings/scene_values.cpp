// SPDX-License-Identifier: Apache-2.0
#include "scene_values.h"

#include <nanobind/stl/array.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

#include <algorithm>
#include <array>
#include <string>
#include <type_traits>
#include <utility>
#include <variant>

#include "camera.h"
#include "lights.h"
#include "wavecomb/core/error.h"
#include "wavecomb/graph/parameters/parameters.h"
#include "wavecomb/material/description/material_table.h"
#include "wavecomb/path/program_reads.h"

namespace nb = nanobind;
using namespace nb::literals;
using namespace wavecomb;

namespace {

// Pairs of a Python name and a member of class `Class`, such as `OpenPbr`.
template <typename Class, typename Value>
using Members = std::vector<std::pair<const char*, Value Class::*>>;

// The macros WAVECOMB_NUMBER_* expand to the OpenPBR inputs that are numbers, and WAVECOMB_COLOUR_*
// to the inputs that are colours. Both expand to nothing for inputs of other types.
#define WAVECOMB_NUMBER_Number(name) {#name, &OpenPbr::name},
#define WAVECOMB_NUMBER_Colour(name)
#define WAVECOMB_NUMBER_Derived(name)
#define WAVECOMB_COLOUR_Number(name)
#define WAVECOMB_COLOUR_Colour(name) {#name, &OpenPbr::name},
#define WAVECOMB_COLOUR_Derived(name)
#define WAVECOMB_NUMBER(kind, name, standard, least, most) WAVECOMB_NUMBER_##kind(name)
#define WAVECOMB_COLOUR(kind, name, standard, least, most) WAVECOMB_COLOUR_##kind(name)
const Members<OpenPbr, Vec3<float>> kOpenPbrColors{
    {"transmission_color", &OpenPbr::transmission_color},
    {"subsurface_radius", &OpenPbr::subsurface_radius},
    {"transmission_scatter", &OpenPbr::transmission_scatter},
    WAVECOMB_OPENPBR_INPUTS(WAVECOMB_COLOUR)};
const Members<OpenPbr, float> kOpenPbrNumbers{
    {"transmission_depth", &OpenPbr::transmission_depth},
    {"transmission_scatter_anisotropy", &OpenPbr::transmission_scatter_anisotropy},
    {"nested_priority", &OpenPbr::nested_priority},
    WAVECOMB_OPENPBR_INPUTS(WAVECOMB_NUMBER)};
const Members<OpenPbr, bool> kOpenPbrSwitches{{"thin_walled", &OpenPbr::thin_walled}};
nb::object to_python(const Vec3<float>& v) {
  return nb::make_tuple(v.x, v.y, v.z);
}
template <typename T>
nb::object to_python(T value) {
  return nb::cast(value);
}

template <typename Class, typename Value>
void put(nb::dict& d, const Class& object, const Members<Class, Value>& members) {
  for (const auto& [name, member] : members) d[name] = to_python(object.*member);
}

/// Reader of parameters from a Python dict. Its error messages begin with `what`.
class Reader {
 public:
  Reader(std::string what, nb::dict values) : what_(std::move(what)), values_(std::move(values)) {}

  template <typename Class, typename Value>
  void take(Class& object, const Members<Class, Value>& members) {
    for (const auto& [name, member] : members) take(name, object.*member);
  }
  template <typename Value>
  void take(const char* name, Value& to) {
    if (const nb::object value = next(name); value.is_valid()) read(name, value, to);
  }
  /// Throws `Error` if the dict has a key that was not read. The message contains `which`, such as
  /// " that can be changed".
  void end(const char* which = "") const {
    if (nb::len(values_) == used_count_) return;
    for (const auto& [key, value] : values_) {
      const std::string name = nb::cast<std::string>(nb::str(key));
      if (known_.find("'" + name + "'") == std::string::npos)
        throw Error(what_ + " has no parameter '" + name + "'" + which + "; there are " + known_);
    }
  }

 private:
  nb::object next(const char* name) {
    known_ += std::string(known_.empty() ? "" : ", ") + "'" + name + "'";
    if (!values_.contains(name)) return {};
    ++used_count_;
    return values_[name];
  }
  [[noreturn]] void fail(const char* name, const char* wanted) const {
    throw Error(what_ + ": " + name + " must be " + wanted);
  }
  void read(const char* name, const nb::object& value, Vec3<float>& to) const {
    std::vector<float> numbers;
    if (!nb::try_cast(value, numbers) || numbers.size() != 3) fail(name, "3 numbers");
    to = {numbers[0], numbers[1], numbers[2]};
  }
  void read(const char* name, const nb::object& value, float& to) const {
    if (!nb::try_cast(value, to)) fail(name, "a number");
  }
  void read(const char* name, const nb::object& value, bool& to) const {
    if (!nb::try_cast(value, to)) fail(name, "True or False");
  }

  std::string what_;
  nb::dict values_;
  std::string known_;
  size_t used_count_ = 0;
};

/// Calls `visit<Value>()` for the value types of material parameters: colours, numbers and flags.
/// The order is the order in which parameters are displayed.
template <typename Visit>
void for_each_kind(const Visit& visit) {
  visit.template operator()<Vec3<float>>();
  visit.template operator()<float>();
  visit.template operator()<bool>();
}

void read_material(Reader& reader, Material& to) {
  for_each_kind([&]<typename Value>() {
    for_each_parameter<Value>(
        to, [&](const MaterialParameter& p, Value& value) { reader.take(p.name, value); });
  });
}

void read_openpbr(Reader& reader, OpenPbr& to) {
  reader.take(to, kOpenPbrColors);
  reader.take(to, kOpenPbrNumbers);
  reader.take(to, kOpenPbrSwitches);
}

/// Returns the names of the parameters that a graph drives.
nb::list driven_names(const Scene& scene, uint32_t graph) {
  nb::list names;
  const GraphSet& graphs = *scene.material_part()->graphs;
  const GraphProgram& program = graphs.programs[graph];
  for (const GraphParameter& p : kGraphParameters)
    for (uint32_t i = 0; i < program.output_count; ++i)
      if (graphs.outputs[program.first_output + i].parameter == graph_parameter(p.name))
        names.append(p.name);
  return names;
}

nb::dict texture_use_dict(const Scene& scene, const TextureUse& use) {
  constexpr const char* kChannels[] = {"r", "g", "b", "a", "rgb"};
  const auto list = [](const auto& values) {
    return std::vector<float>(values.begin(), values.end());
  };
  nb::dict d;
  d["texture"] = use.texture;
  d["name"] = scene.textures()[use.texture]->name();
  d["channel"] = kChannels[use.channel];
  d["scale"] = list(use.scale);
  d["bias"] = list(use.bias);
  d["uv"] = list(use.uv);
  return d;
}

/// Calls `change(id, values)` for each item of `changes`, a dict from object index to a dict of
/// values.
template <typename Change>
void for_each_change(const char* kind, const nb::dict& changes, const Change& change) {
  for (const auto& [key, value] : changes) {
    uint32_t id = 0;
    if (!nb::try_cast(key, id) || !nb::isinstance<nb::dict>(value))
      throw Error(std::string("edits must be a dict {") + kind + " index: {parameter: value}}");
    change(id, nb::cast<nb::dict>(value));
  }
}

}  // namespace

std::optional<uint32_t> index_in(const std::vector<const char*>& choices, nb::handle value) {
  std::string chosen;
  if (!nb::try_cast(value, chosen)) return std::nullopt;
  const auto found = std::find(choices.begin(), choices.end(), chosen);
  if (found == choices.end()) return std::nullopt;
  return static_cast<uint32_t>(found - choices.begin());
}

std::string listed(std::span<const char* const> choices) {
  std::string list;
  for (const char* one : choices) list += (list.empty() ? "" : ", ") + std::string(one);
  return list;
}

void check_index(const char* kind, uint32_t i, size_t count) {
  if (i >= count)
    throw Error(std::string(kind) + " " + std::to_string(i) + " is not there; the scene has " +
                std::to_string(count));
}

nb::list matrix(const Affine& m) {
  nb::list rows;
  for (int i = 0; i < 3; ++i) {
    const Vec3<float> axis = m.axis(i);
    rows.append(std::vector<float>{axis.x, axis.y, axis.z, 0});
  }
  rows.append(std::vector<float>{m.t.x, m.t.y, m.t.z, 1});
  return rows;
}

Affine matrix_of(const std::string& what, nb::handle value) {
  try {
    const nb::object array =
        nb::module_::import_("numpy").attr("ascontiguousarray")(value, "float64");
    return affine(nb::cast<nb::ndarray<nb::c_contig, nb::device::cpu, nb::ro>>(array));
  } catch (const std::exception&) {
    throw Error(what + " must be 4 x 4 numbers");
  }
}

OpenPbr openpbr_of(const std::string& material, const nb::dict& values) {
  OpenPbr to;
  Reader reader("openpbr of material '" + material + "'", values);
  read_openpbr(reader, to);
  reader.end();
  return to;
}

Affine affine(const nb::ndarray<nb::c_contig, nb::device::cpu, nb::ro>& m) {
  if (m.ndim() != 2 || m.shape(0) != 4 || m.shape(1) != 4) throw Error("a transform must be 4 x 4");
  if (m.dtype() == nb::dtype<double>()) return affine(static_cast<const double*>(m.data()));
  if (m.dtype() == nb::dtype<float>()) return affine(static_cast<const float*>(m.data()));
  throw Error("a transform must be of float32 or float64");
}

void read_parameters(Material& material, const nb::kwargs& values) {
  Reader reader("material '" + material.name + "'", values);
  read_material(reader, material);
  reader.end();
}

nb::list material_rows() {
  const Material standard;
  nb::list rows;
  for (const MaterialParameter& p : material_table()) {
    nb::dict d;
    d["name"] = p.name;
    if (const SpecificParameter* own = p.own()) {
      const ProgramParameter& info = own->info();
      d["kind"] = "number";
      d["default"] = info.standard;
      d["program"] = info_of(own->program).name;
      d["least"] = info.least;
      d["most"] = info.most;
    }
    for_each_kind([&]<typename Value>() {
      if (const auto* member = std::get_if<Value Material::*>(&p.accessor)) {
        d["kind"] = std::is_same_v<Value, float>  ? "number"
                    : std::is_same_v<Value, bool> ? "flag"
                                                  : "colour";
        d["default"] = to_python(standard.**member);
      }
    });
    rows.append(d);
  }
  return rows;
}

nb::list program_rows() {
  nb::list rows;
  for (uint32_t id = 0; id < kSurfaceProgramCount; ++id) {
    const ProgramReads reads = reads_of(static_cast<ProgramId>(id));
    nb::list inputs;
    for (uint32_t i = 0; i < kInputCount; ++i)
      if ((reads.inputs >> i & 1) != 0) inputs.append(kInputNames[i]);
    nb::dict d;
    d["name"] = kPrograms[id].name;
    d["inputs"] = nb::tuple(inputs);
    d["reads_ior"] = reads.ior;
    d["has_more"] = reads.has_more;
    rows.append(d);
  }
  return rows;
}

nb::dict material_dict(const Scene& scene, uint32_t material) {
  check_index("material", material, scene.materials().size());
  const Material& m = scene.materials()[material];
  nb::dict d, textures;
  d["name"] = m.name;
  d["program"] = kProgramNames[static_cast<size_t>(m.program)];
  for_each_kind([&]<typename Value>() {
    for_each_parameter<Value>(
        m, [&](const MaterialParameter& p, const Value& value) { d[p.name] = to_python(value); });
  });
  for (uint32_t s = 0; s < kInputCount; ++s)
    if (m.has_texture(static_cast<Input>(s)))
      textures[kInputNames[s]] = texture_use_dict(scene, m.textures[s]);
  d["textures"] = textures;
  if (m.graph != kNoGraph) d["driven"] = driven_names(scene, m.graph);
  if (m.program == ProgramId::kOpenPbr) {
    nb::dict openpbr;
    put(openpbr, m.openpbr, kOpenPbrColors);
    put(openpbr, m.openpbr, kOpenPbrNumbers);
    put(openpbr, m.openpbr, kOpenPbrSwitches);
    d["openpbr"] = openpbr;
  }
  return d;
}

SceneEdit scene_edit(const Scene& scene, const nb::object& camera, const nb::dict& materials,
                     const nb::dict& lights, const nb::dict& moves) {
  SceneEdit edit;
  if (!camera.is_none()) edit.camera = edited_camera(scene, nb::cast<nb::dict>(camera));
  for_each_change("material", materials, [&](uint32_t id, const nb::dict& values) {
    check_index("material", id, scene.materials().size());
    Material changed = scene.materials()[id];
    Reader reader("material '" + changed.name + "'", values);
    read_material(reader, changed);
    if (changed.program == ProgramId::kOpenPbr) read_openpbr(reader, changed.openpbr);
    reader.end(" that can be changed");
    edit.materials[id] = std::move(changed);
  });
  for_each_change("light", lights, [&](uint32_t i, const nb::dict& values) {
    edit.lights[i] = edited_light(scene, i, values);
  });
  for (const auto& [key, value] : moves) {
    std::string path;
    if (!nb::try_cast(key, path)) throw Error("moves must be a dict {prim path: 4 x 4 matrix}");
    edit.moves[path] = matrix_of("the move of prim '" + path + "'", value);
  }
  return edit;
}
