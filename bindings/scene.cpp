// SPDX-License-Identifier: Apache-2.0
#include <nanobind/ndarray.h>
#include <nanobind/stl/array.h>
#include <nanobind/stl/map.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/pair.h>
#include <nanobind/stl/shared_ptr.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/tuple.h>
#include <nanobind/stl/vector.h>

#include <cinttypes>
#include <cstdio>
#include <cstring>

#include "bind.h"
#include "camera.h"
#include "lights.h"
#include "scene_values.h"
#include "statistics.h"
#include "wavecomb/core/error.h"
#include "wavecomb/scene/fingerprint.h"
#include "wavecomb/scene/light_table.h"
#include "wavecomb/scene/scene.h"
#include "wavecomb/texture/tile_store.h"

namespace nb = nanobind;
using namespace wavecomb;

namespace {

using Color3 = std::tuple<float, float, float>;
template <typename T>
using Array = nb::ndarray<const T, nb::c_contig, nb::device::cpu>;

Vec3<float> vec3(const Color3& c) {
  return {std::get<0>(c), std::get<1>(c), std::get<2>(c)};
}

/// Keeps arrays alive from C++; they are let go of with the GIL held.
std::shared_ptr<const void> hold(nb::list arrays) {
  return {new nb::list(std::move(arrays)), [](const void* p) {
            const nb::gil_scoped_acquire gil;
            delete static_cast<const nb::list*>(p);
          }};
}

template <typename Enum>
Enum choose(const std::string& what, const std::string& value,
            std::initializer_list<std::pair<const char*, Enum>> choices) {
  std::string list;
  for (const auto& [name, e] : choices) {
    if (value == name) return e;
    list += (list.empty() ? "" : ", ") + std::string(name);
  }
  throw Error(what + " is '" + value + "'; it must be one of " + list);
}

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

Slot slot(const std::string& name) {
  std::string list;
  for (uint32_t s = 0; s < kSlotCount; ++s) {
    if (name == kSlotNames[s]) return static_cast<Slot>(s);
    list += (list.empty() ? "" : ", ") + std::string(kSlotNames[s]);
  }
  throw Error("texture slot '" + name + "' is not known; it must be one of " + list);
}

ProgramId program(const std::string& name) {
  std::string list;
  for (uint32_t p = 0; p < kProgramCount; ++p) {
    if (name == kProgramNames[p]) return static_cast<ProgramId>(p);
    list += (list.empty() ? "" : ", ") + std::string(kProgramNames[p]);
  }
  throw Error("program '" + name + "' is not known; it must be one of " + list);
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
  const nb::gil_scoped_release release;  // others may read images meanwhile
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
                      const std::string& name, const Color3& base_color,
                      const Color3& specular_color, const Color3& emission, float roughness,
                      float metallic, float clearcoat, float clearcoat_roughness, float opacity,
                      float ior, float opacity_threshold, const Color3& conductor_eta,
                      const Color3& conductor_k, bool specular_workflow, bool presence,
                      const nb::dict& openpbr, const nb::dict& textures,
                      std::optional<uint32_t> graph, std::optional<uint32_t> opacity_graph,
                      std::optional<uint32_t> emission_graph) {
  Material m;
  m.name = name;
  m.program = program(program_name);
  m.base_color = vec3(base_color);
  m.specular_color = vec3(specular_color);
  m.emission = vec3(emission);
  m.roughness = roughness;
  m.metallic = metallic;
  m.clearcoat = clearcoat;
  m.clearcoat_roughness = clearcoat_roughness;
  m.opacity = opacity;
  m.ior = ior;
  m.opacity_threshold = opacity_threshold;
  m.conductor_eta = vec3(conductor_eta);
  m.conductor_k = vec3(conductor_k);
  m.specular_workflow = specular_workflow;
  m.presence = presence;
  m.openpbr = openpbr_of(name, openpbr);
  m.graph = graph.value_or(kNoGraph);
  m.opacity_graph = opacity_graph.value_or(kNoGraph);
  m.emission_graph = emission_graph.value_or(kNoGraph);
  for (const auto& [key, value] : textures)
    m.textures[static_cast<size_t>(slot(nb::cast<std::string>(key)))] =
        texture_use(nb::cast<nb::dict>(value));
  return builder.add_material(std::move(m));
}

/// Per vertex when (n, k), per corner when (m, 3, k); with steps before that where it `deforms`.
Attribute attribute_of(const std::optional<Array<float>>& values, size_t k, const std::string& name,
                       bool deforms = false) {
  if (!values) return Attribute::kNone;
  const size_t first = deforms ? 1 : 0, n = values->ndim();
  if (n == first + 2 && values->shape(first + 1) == k) return Attribute::kVertex;
  if (n == first + 3 && values->shape(first + 1) == 3 && values->shape(first + 2) == k)
    return Attribute::kCorner;
  throw Error("mesh '" + name + "' has attributes that are neither per vertex nor per corner");
}

/// Attributes by name, each a rate and an array (values, components). `owners` collects the arrays.
std::vector<MeshAttribute> attributes_of(SceneBuilder& builder, const nb::dict& attributes,
                                         nb::list& owners) {
  std::vector<MeshAttribute> out;
  for (const auto& [key, value] : attributes) {
    const auto name = nb::cast<std::string>(key);
    const auto [rate, values] = nb::cast<std::pair<std::string, Array<float>>>(value);
    if (values.ndim() != 2)
      throw Error("attribute '" + name + "' must have the shape (values, components)");
    out.push_back({builder.attribute(name),
                   choose<AttributeRate>("rate of attribute '" + name + "'", rate,
                                         {{"constant", AttributeRate::kConstant},
                                          {"primitive", AttributeRate::kPrimitive},
                                          {"vertex", AttributeRate::kVertex},
                                          {"corner", AttributeRate::kCorner},
                                          {"end", AttributeRate::kEnd}}),
                   static_cast<uint32_t>(std::min<size_t>(values.shape(1), 5)),
                   {values.data(), values.size()}});
    owners.append(nb::cast(values));
  }
  return out;
}

/// Arrays as a mesh; they are kept alive, not copied.
Mesh make_mesh(SceneBuilder& builder, const Array<float>& positions,
               const nb::ndarray<nb::c_contig, nb::device::cpu, nb::ro>& indices,
               const std::optional<Array<float>>& normals, const std::optional<Array<float>>& uvs,
               const std::optional<Array<uint32_t>>& face_materials, uint32_t material,
               const nb::dict& attributes, const std::string& name) {
  Mesh mesh;
  mesh.name = name;
  const bool deforms = positions.ndim() == 3;
  if ((positions.ndim() != 2 && !deforms) || positions.shape(positions.ndim() - 1) != 3 ||
      indices.ndim() != 2 || indices.shape(1) != 3)
    throw Error("mesh '" + name +
                "' needs positions of shape (n, 3), or (steps, n, 3), and indices of shape (m, 3)");
  if (deforms) mesh.steps = static_cast<uint32_t>(std::min<size_t>(positions.shape(0), 1u << 30));
  if (indices.dtype() != nb::dtype<uint32_t>() && indices.dtype() != nb::dtype<int32_t>())
    throw Error("mesh '" + name + "' needs indices of int32 or uint32");
  mesh.positions = {positions.data(), positions.size()};
  mesh.indices = {static_cast<const uint32_t*>(indices.data()), indices.size()};
  nb::list owners;
  owners.append(nb::cast(positions));
  owners.append(nb::cast(indices));
  mesh.normals_at = attribute_of(normals, 3, name, deforms);
  if (normals) {
    mesh.normals = {normals->data(), normals->size()};
    owners.append(nb::cast(*normals));
  }
  mesh.uvs_at = attribute_of(uvs, 2, name);
  if (uvs) {
    mesh.uvs = {uvs->data(), uvs->size()};
    owners.append(nb::cast(*uvs));
  }
  if (face_materials) {
    mesh.face_materials = {face_materials->data(), face_materials->size()};
    owners.append(nb::cast(*face_materials));
  }
  mesh.attributes = attributes_of(builder, attributes, owners);
  mesh.material = material;
  mesh.owner = hold(std::move(owners));
  return mesh;
}

uint32_t add_mesh(SceneBuilder& builder, const Array<float>& positions,
                  const nb::ndarray<nb::c_contig, nb::device::cpu, nb::ro>& indices,
                  const std::optional<Array<float>>& normals,
                  const std::optional<Array<float>>& uvs,
                  const std::optional<Array<uint32_t>>& face_materials, uint32_t material,
                  const nb::dict& attributes, const std::string& name,
                  const std::string& light_group, uint32_t asset_length,
                  std::optional<uint32_t> mesh_light) {
  Mesh mesh = make_mesh(builder, positions, indices, normals, uvs, face_materials, material,
                        attributes, name);
  mesh.light_group = builder.light_group(light_group);
  mesh.asset_length = asset_length;
  mesh.mesh_light = mesh_light.value_or(kNoLight);
  return builder.add_mesh(std::move(mesh));
}

void replace_mesh(SceneBuilder& builder, uint32_t id, const Array<float>& positions,
                  const nb::ndarray<nb::c_contig, nb::device::cpu, nb::ro>& indices,
                  const std::optional<Array<float>>& normals,
                  const std::optional<Array<float>>& uvs,
                  const std::optional<Array<uint32_t>>& face_materials, uint32_t material,
                  const nb::dict& attributes) {
  builder.replace_mesh(id, make_mesh(builder, positions, indices, normals, uvs, face_materials,
                                     material, attributes, ""));
}

/// What curves and points have in common, ready but for primitive, segments and normals. `owners`
/// collects their arrays.
Mesh curved_mesh(SceneBuilder& builder, const Array<float>& positions, const Array<float>& radii,
                 const std::optional<Array<float>>& uvs,
                 const std::optional<Array<uint32_t>>& face_materials, uint32_t material,
                 const nb::dict& attributes, const std::string& name,
                 const std::string& light_group, uint32_t asset_length, nb::list& owners) {
  Mesh mesh;
  mesh.name = name;
  mesh.light_group = builder.light_group(light_group);
  mesh.asset_length = asset_length;
  mesh.material = material;
  const bool deforms = positions.ndim() == 3;
  if ((positions.ndim() != 2 && !deforms) || positions.shape(positions.ndim() - 1) != 3)
    throw Error("mesh '" + name + "' needs positions of shape (n, 3) or (steps, n, 3)");
  if (deforms) mesh.steps = static_cast<uint32_t>(std::min<size_t>(positions.shape(0), 1u << 30));
  mesh.positions = {positions.data(), positions.size()};
  mesh.radii = {radii.data(), radii.size()};
  owners.append(nb::cast(positions));
  owners.append(nb::cast(radii));
  if (uvs) {
    mesh.uvs = {uvs->data(), uvs->size()};
    mesh.uvs_at = Attribute::kCorner;
    owners.append(nb::cast(*uvs));
  }
  if (face_materials) {
    mesh.face_materials = {face_materials->data(), face_materials->size()};
    owners.append(nb::cast(*face_materials));
  }
  mesh.attributes = attributes_of(builder, attributes, owners);
  return mesh;
}

uint32_t add_curves(SceneBuilder& builder, const std::string& kind, const Array<float>& positions,
                    const Array<uint32_t>& segments, const Array<float>& radii,
                    const std::optional<Array<float>>& normals,
                    const std::optional<Array<float>>& uvs,
                    const std::optional<Array<uint32_t>>& face_materials, uint32_t material,
                    const nb::dict& attributes, const std::string& name,
                    const std::string& light_group, uint32_t asset_length) {
  nb::list owners;
  Mesh mesh = curved_mesh(builder, positions, radii, uvs, face_materials, material, attributes,
                          name, light_group, asset_length, owners);
  mesh.primitive = choose<Primitive>("kind of curves", kind,
                                     {{"linear-tube", Primitive::kLinearTube},
                                      {"cubic-tube", Primitive::kCubicTube},
                                      {"linear-ribbon", Primitive::kLinearRibbon},
                                      {"cubic-ribbon", Primitive::kCubicRibbon}});
  mesh.indices = {segments.data(), segments.size()};
  owners.append(nb::cast(segments));
  if (normals) {
    mesh.normals = {normals->data(), normals->size()};
    owners.append(nb::cast(*normals));
  }
  mesh.owner = hold(std::move(owners));
  return builder.add_mesh(std::move(mesh));
}

uint32_t add_points(SceneBuilder& builder, const Array<float>& positions, const Array<float>& radii,
                    const std::optional<Array<float>>& uvs,
                    const std::optional<Array<uint32_t>>& face_materials, uint32_t material,
                    const nb::dict& attributes, const std::string& name,
                    const std::string& light_group, uint32_t asset_length) {
  nb::list owners;
  Mesh mesh = curved_mesh(builder, positions, radii, uvs, face_materials, material, attributes,
                          name, light_group, asset_length, owners);
  mesh.primitive = Primitive::kSphere;
  mesh.owner = hold(std::move(owners));
  return builder.add_mesh(std::move(mesh));
}

void add_instances(SceneBuilder& builder, uint32_t parent, uint32_t child,
                   const nb::ndarray<nb::c_contig, nb::device::cpu, nb::ro>& transforms,
                   const std::optional<Array<uint32_t>>& materials,
                   const std::optional<std::vector<std::string>>& names,
                   const std::optional<Array<uint32_t>>& numbers,
                   const std::optional<std::vector<uint32_t>>& asset_lengths,
                   const std::optional<Array<double>>& motion) {
  if (transforms.ndim() != 3 || transforms.shape(1) != 4 || transforms.shape(2) != 4)
    throw Error("transforms of instances must have the shape (k, 4, 4)");
  const bool is_double = transforms.dtype() == nb::dtype<double>();
  if (!is_double && transforms.dtype() != nb::dtype<float>())
    throw Error("transforms of instances must be of float32 or float64");
  const size_t k = transforms.shape(0);
  if (materials && (materials->ndim() != 1 || materials->shape(0) != k))
    throw Error("materials of instances must be one for each transform");
  if (names && names->size() != 1 && names->size() != k)
    throw Error("names of instances must be one, or one for each transform");
  if (numbers && (numbers->ndim() != 1 || numbers->shape(0) != k))
    throw Error("numbers of instances must be one for each transform");
  if (asset_lengths && (!names || asset_lengths->size() != names->size()))
    throw Error("asset lengths of instances must be one for each name");
  if (motion && (motion->ndim() != 4 || motion->shape(0) != k || motion->shape(2) != 4 ||
                 motion->shape(3) != 4))
    throw Error("the motion of instances must have the shape (k, steps, 4, 4)");
  const size_t steps = motion ? motion->shape(1) : 0;
  std::vector<Affine> moved(steps);
  std::vector<uint32_t> texts;
  for (size_t i = 0; names && i < names->size(); ++i)
    texts.push_back(
        builder.add_placement_name((*names)[i], asset_lengths ? (*asset_lengths)[i] : 0));
  for (size_t i = 0; i < k; ++i) {
    for (size_t s = 0; s < steps; ++s) moved[s] = affine(motion->data() + 16 * (i * steps + s));
    builder.add_instance(parent, child,
                         is_double ? affine(static_cast<const double*>(transforms.data()) + 16 * i)
                                   : affine(static_cast<const float*>(transforms.data()) + 16 * i),
                         materials ? materials->data()[i] : kInheritMaterial,
                         texts.empty() ? kNoName : texts[texts.size() == 1 ? 0 : i],
                         numbers ? numbers->data()[i] : kNoName, moved);
  }
}

uint32_t add_geometry_set(SceneBuilder& builder, const std::map<std::string, std::string>& rules) {
  GeometrySet set;
  for (const auto& [path, rule] : rules)
    set.entries.push_back({path, choose<PathRule>("rule", rule,
                                                  {{"exclude", PathRule::kExclude},
                                                   {"explicit", PathRule::kExplicit},
                                                   {"expand", PathRule::kExpand}})});
  return builder.add_geometry_set(std::move(set));
}

uint32_t add_ies(SceneBuilder& builder, std::vector<float> vertical, std::vector<float> horizontal,
                 const Array<float>& candela) {
  IesProfile profile{std::move(vertical), std::move(horizontal), {}};
  profile.candela.assign(candela.data(), candela.data() + candela.size());
  return builder.add_ies(std::move(profile));
}

}  // namespace

void bind_scene(nb::module_& m) {
  using namespace nb::literals;
  m.attr("INHERIT_MATERIAL") = kInheritMaterial;

  nb::class_<TileStore>(m, "TextureStore")
      .def(nb::init<uint64_t, std::string>(), "limit_bytes"_a, "folder"_a)
      .def_static("obstacle", &UserFaults::obstacle)
      .def_prop_ro("limit_bytes", &TileStore::limit_bytes)
      .def("set_waiting", &TileStore::set_waiting, "bytes"_a)
      .def_prop_ro("statistics",
                   [](const TileStore& store) { return texture_store_dict(store.statistics()); });

  nb::class_<Scene>(m, "Scene")
      .def_prop_ro("triangles", &Scene::unique_triangles)
      .def_prop_ro("instanced_triangles", &Scene::instanced_triangles)
      .def_prop_ro("curve_segments", &Scene::curve_segments)
      .def_prop_ro("points", &Scene::points)
      .def_prop_ro("mesh_count", [](const Scene& s) { return s.meshes().size(); })
      .def_prop_ro("instance_count", [](const Scene& s) { return s.instances().size(); })
      .def_prop_ro("light_count", [](const Scene& s) { return s.lights().size(); })
      .def_prop_ro("lights",
                   [](const Scene& s) {
                     std::vector<std::pair<std::string, std::string>> out;
                     for (const Light& light : s.lights())
                       out.emplace_back(light.name, light_kind_name(light.kind));
                     return out;
                   })
      .def_prop_ro("materials",
                   [](const Scene& s) {
                     std::vector<std::pair<std::string, std::string>> out;
                     for (const Material& material : s.materials())
                       out.emplace_back(material.name,
                                        kProgramNames[static_cast<size_t>(material.program)]);
                     return out;
                   })
      .def_prop_ro("textures",
                   [](const Scene& s) {
                     std::vector<std::pair<std::string, size_t>> out;
                     for (const auto& texture : s.textures())
                       out.emplace_back(texture->name(), texture->bytes());
                     return out;
                   })
      .def_prop_ro("camera", &camera_dict)
      .def("material", &material_dict, "material"_a)
      .def("light", &light_dict, "light"_a)
      .def_prop_ro("light_groups", &Scene::light_groups)
      .def_prop_ro("object_names",
                   [](const Scene& s) {
                     const ObjectNames names(s);
                     std::vector<std::pair<std::string, std::string>> out;
                     for (uint32_t i = 0; i < names.count(); ++i)
                       out.emplace_back(names.object(i), names.asset(i));
                     return out;
                   })
      .def(
          "fingerprint",
          [](const Scene& s, bool arrays) {
            nb::dict d;
            for (const auto& [part, hash] : fingerprint(s, arrays)) {
              char text[17];
              std::snprintf(text, sizeof(text), "%016" PRIx64, hash);
              d[part.c_str()] = text;
            }
            return d;
          },
          "arrays"_a = true)
      .def_prop_ro("moves",
                   [](const Scene& s) { return s.view().has_motion || !s.camera().steps.empty(); })
      .def_prop_ro("warnings", &Scene::warnings)
      .def_prop_ro("bounds", [](const Scene& s) {
        const Bounds& b = s.bounds();
        return std::make_pair(Color3{b.lo.x, b.lo.y, b.lo.z}, Color3{b.hi.x, b.hi.y, b.hi.z});
      });

  const Color3 grey{0.18f, 0.18f, 0.18f}, black{0.f, 0.f, 0.f};
  nb::class_<SceneBuilder>(m, "SceneBuilder")
      .def(nb::init<uint32_t, std::shared_ptr<TileStore>>(), "threads"_a = 0,
           "store"_a.none() = nb::none())
      .def("add_texture", &add_texture, "pixels"_a, nb::kw_only(), "srgb"_a, "wrap_s"_a = "repeat",
           "wrap_t"_a = "repeat", "name"_a = "")
      .def("share_texture", &share_texture, "scene"_a, "texture"_a)
      .def("add_tiles", &SceneBuilder::add_tiles, "name"_a, "tiles"_a, "missing"_a)
      .def("add_graph", &add_graph, "ops"_a, "constants"_a, "images"_a, "outputs"_a,
           "attributes"_a = std::vector<std::string>())
      .def("add_material", &add_material, "program"_a, nb::kw_only(), "name"_a = "",
           "base_color"_a = grey, "specular_color"_a = black, "emission"_a = black,
           "roughness"_a = 0.5f, "metallic"_a = 0.f, "clearcoat"_a = 0.f,
           "clearcoat_roughness"_a = 0.01f, "opacity"_a = 1.f, "ior"_a = 1.5f,
           "opacity_threshold"_a = 0.f, "conductor_eta"_a = black, "conductor_k"_a = black,
           "specular_workflow"_a = false, "presence"_a = false, "openpbr"_a = nb::dict(),
           "textures"_a = nb::dict(), "graph"_a = nb::none(), "opacity_graph"_a = nb::none(),
           "emission_graph"_a = nb::none())
      .def("add_mesh", &add_mesh, "positions"_a, "indices"_a, nb::kw_only(),
           "normals"_a = nb::none(), "uvs"_a = nb::none(), "face_materials"_a = nb::none(),
           "material"_a = kInheritMaterial, "attributes"_a = nb::dict(), "name"_a = "",
           "light_group"_a = "", "asset_length"_a = 0, "mesh_light"_a = nb::none())
      .def("replace_mesh", &replace_mesh, "mesh"_a, "positions"_a, "indices"_a, nb::kw_only(),
           "normals"_a = nb::none(), "uvs"_a = nb::none(), "face_materials"_a = nb::none(),
           "material"_a = kInheritMaterial, "attributes"_a = nb::dict())
      .def("make_surfaces", &make_surfaces, "descriptions"_a, "threads"_a = 0)
      .def("add_curves", &add_curves, "kind"_a, "positions"_a, "segments"_a, "radii"_a,
           nb::kw_only(), "normals"_a = nb::none(), "uvs"_a = nb::none(),
           "face_materials"_a = nb::none(), "material"_a = kInheritMaterial,
           "attributes"_a = nb::dict(), "name"_a = "", "light_group"_a = "", "asset_length"_a = 0)
      .def("add_points", &add_points, "positions"_a, "radii"_a, nb::kw_only(), "uvs"_a = nb::none(),
           "face_materials"_a = nb::none(), "material"_a = kInheritMaterial,
           "attributes"_a = nb::dict(), "name"_a = "", "light_group"_a = "", "asset_length"_a = 0)
      .def("add_group", &SceneBuilder::add_group, "name"_a = "", "root"_a = "")
      .def("add_to_group", &SceneBuilder::add_to_group, "group"_a, "mesh"_a)
      .def("add_instances", &add_instances, "parent"_a, "child"_a, "transforms"_a,
           "materials"_a = nb::none(), nb::kw_only(), "names"_a = nb::none(),
           "numbers"_a = nb::none(), "asset_lengths"_a = nb::none(), "motion"_a = nb::none())
      .def("add_light", &add_light, "kind"_a, "transform"_a, "values"_a)
      .def("add_mesh_light", &add_mesh_light, "transform"_a, "material_sync"_a, "values"_a)
      .def("add_geometry_set", &add_geometry_set, "rules"_a)
      .def("add_ies", &add_ies, "vertical"_a, "horizontal"_a, "candela"_a)
      .def("set_camera", &set_camera, "transform"_a, "values"_a)
      .def("build", &SceneBuilder::build, nb::call_guard<nb::gil_scoped_release>());
}
