// SPDX-License-Identifier: Apache-2.0
/// Bindings of SceneBuilder for meshes, curves, points, Gaussian splats and instances.
#include <nanobind/ndarray.h>
#include <nanobind/stl/array.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/pair.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/tuple.h>
#include <nanobind/stl/vector.h>

#include <algorithm>
#include <array>
#include <numeric>

#include "arguments.h"
#include "bind.h"
#include "scene_values.h"
#include "wavecomb/geometry/gaussian_splat/gaussian_splat.h"
#include "wavecomb/scene/scene.h"

namespace nb = nanobind;
using namespace wavecomb;

namespace {

/// Value in the array of group indices for meshes that belong to no group.
constexpr uint32_t kNoGroup = 0xffffffffu;

/// Returns an object with which C++ code keeps NumPy arrays alive. Its deleter acquires the GIL
/// before it releases the arrays.
std::shared_ptr<const void> own_arrays(nb::list arrays) {
  return {new nb::list(std::move(arrays)), [](const void* p) {
            const nb::gil_scoped_acquire gil;
            delete static_cast<const nb::list*>(p);
          }};
}

/// Returns `kVertex` for values of shape (n, k) and `kCorner` for values of shape (m, 3, k). If the
/// mesh `deforms`, the shape begins with the number of motion steps.
Attribute attribute_of(const std::optional<Array<float>>& values, size_t k, const std::string& name,
                       bool deforms = false) {
  if (!values) return Attribute::kNone;
  const size_t first = deforms ? 1 : 0, n = values->ndim();
  if (n == first + 2 && values->shape(first + 1) == k) return Attribute::kVertex;
  if (n == first + 3 && values->shape(first + 1) == 3 && values->shape(first + 2) == k)
    return Attribute::kCorner;
  throw Error("mesh '" + name + "' has attributes that are neither per vertex nor per corner");
}

/// Converts a dict of mesh attributes. Each item of the dict is a pair of the attribute's rate and
/// an array of shape (values, components). Appends the arrays to `owners`, which keeps them alive.
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

/// Creates a mesh that refers to the NumPy arrays without copying them, and keeps the arrays alive.
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
  mesh.owner = own_arrays(std::move(owners));
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

/// Adds several triangle meshes without normals and texture coordinates. The arguments contain the
/// concatenated arrays of all meshes. Returns the id of the first mesh.
uint32_t add_meshes(SceneBuilder& builder, const Array<float>& positions,
                    const Array<uint32_t>& indices, const Array<uint32_t>& points,
                    const Array<uint32_t>& triangles, const Array<uint32_t>& materials,
                    const Array<uint32_t>& asset_lengths, const Array<uint32_t>& groups,
                    const std::vector<std::string>& names) {
  const size_t count = names.size();
  if (positions.ndim() != 2 || positions.shape(1) != 3 || indices.ndim() != 2 ||
      indices.shape(1) != 3)
    throw Error("meshes need positions of shape (n, 3) and indices of shape (m, 3)");
  for (const Array<uint32_t>* each : {&points, &triangles, &materials, &asset_lengths, &groups})
    if (each->ndim() != 1 || each->size() != count)
      throw Error("meshes need one value of each array per name");
  const auto total = [&](const Array<uint32_t>& sizes) {
    return std::accumulate(sizes.data(), sizes.data() + count, uint64_t{0});
  };
  if (total(points) != positions.shape(0) || total(triangles) != indices.shape(0))
    throw Error("the sizes of the meshes do not match their arrays");
  nb::list owners;
  owners.append(nb::cast(positions));
  owners.append(nb::cast(indices));
  const std::shared_ptr<const void> owner = own_arrays(std::move(owners));
  const float* position = positions.data();
  const uint32_t* index = indices.data();
  uint32_t first = 0;
  for (size_t i = 0; i < count; ++i) {
    Mesh mesh;
    mesh.name = names[i];
    mesh.positions = {position, 3 * size_t{points.data()[i]}};
    mesh.indices = {index, 3 * size_t{triangles.data()[i]}};
    mesh.material = materials.data()[i];
    mesh.asset_length = asset_lengths.data()[i];
    mesh.owner = owner;
    position += mesh.positions.size();
    index += mesh.indices.size();
    const uint32_t id = builder.add_mesh(std::move(mesh));
    if (i == 0) first = id;
    if (groups.data()[i] != kNoGroup) builder.add_to_group(groups.data()[i], id);
  }
  return first;
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

/// Creates the `Mesh` of a curve or point primitive with the members that both have in common. The
/// caller sets the primitive type, segments and normals. Appends the arrays to `owners`, which
/// keeps them alive.
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
  mesh.owner = own_arrays(std::move(owners));
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
  mesh.owner = own_arrays(std::move(owners));
  return builder.add_mesh(std::move(mesh));
}

/// Gaussian splats as packed rows, and the radius of each splat's bounding sphere.
struct GaussianSplatArrays {
  std::vector<GaussianSplatRow> rows;
  std::vector<float> radii;
};

uint32_t add_gaussian_splats(SceneBuilder& builder, const Array<float>& positions,
                             const Array<float>& scales, const Array<float>& orientations,
                             const Array<float>& opacities, const Array<float>& harmonics,
                             uint32_t material, const std::string& name,
                             const std::string& light_group, uint32_t asset_length) {
  const std::string what = "mesh '" + name + "'";
  auto arrays = std::make_unique<GaussianSplatArrays>();
  arrays->rows = make_gaussian_splat_rows({scales.data(), scales.size()},
                                          {orientations.data(), orientations.size()},
                                          {opacities.data(), opacities.size()}, what);
  arrays->radii = gaussian_splat_radii(arrays->rows);
  size_t degree = 0;
  while (degree < 3 && harmonics.ndim() == 3 && harmonics.shape(1) > (degree + 1) * (degree + 1))
    ++degree;
  if (harmonics.ndim() != 3 || harmonics.shape(1) != (degree + 1) * (degree + 1) ||
      harmonics.shape(2) != 3)
    throw Error(what + " needs harmonics of shape (n, 1, 3), (n, 4, 3), (n, 9, 3) or (n, 16, 3)");
  Mesh mesh;
  mesh.name = name;
  mesh.primitive = Primitive::kGaussianSplat;
  mesh.light_group = builder.light_group(light_group);
  mesh.asset_length = asset_length;
  mesh.material = material;
  mesh.positions = {positions.data(), positions.size()};
  mesh.radii = arrays->radii;
  mesh.splats = arrays->rows;
  mesh.harmonics = {harmonics.data(), harmonics.size()};
  mesh.harmonics_degree = static_cast<uint32_t>(degree);
  nb::list owners;
  owners.append(nb::cast(positions));
  owners.append(nb::cast(harmonics));
  owners.append(nb::capsule(arrays.release(),
                            [](void* p) noexcept { delete static_cast<GaussianSplatArrays*>(p); }));
  mesh.owner = own_arrays(std::move(owners));
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

}  // namespace

void def_meshes(nb::class_<SceneBuilder>& builder) {
  using namespace nb::literals;
  builder
      .def("add_mesh", &add_mesh, "positions"_a, "indices"_a, nb::kw_only(),
           "normals"_a = nb::none(), "uvs"_a = nb::none(), "face_materials"_a = nb::none(),
           "material"_a = kInheritMaterial, "attributes"_a = nb::dict(), "name"_a = "",
           "light_group"_a = "", "asset_length"_a = 0, "mesh_light"_a = nb::none())
      .def("add_meshes", &add_meshes, "positions"_a, "indices"_a, "points"_a, "triangles"_a,
           "materials"_a, "asset_lengths"_a, "groups"_a, "names"_a)
      .def("replace_mesh", &replace_mesh, "mesh"_a, "positions"_a, "indices"_a, nb::kw_only(),
           "normals"_a = nb::none(), "uvs"_a = nb::none(), "face_materials"_a = nb::none(),
           "material"_a = kInheritMaterial, "attributes"_a = nb::dict())
      .def("add_curves", &add_curves, "kind"_a, "positions"_a, "segments"_a, "radii"_a,
           nb::kw_only(), "normals"_a = nb::none(), "uvs"_a = nb::none(),
           "face_materials"_a = nb::none(), "material"_a = kInheritMaterial,
           "attributes"_a = nb::dict(), "name"_a = "", "light_group"_a = "", "asset_length"_a = 0)
      .def("add_points", &add_points, "positions"_a, "radii"_a, nb::kw_only(), "uvs"_a = nb::none(),
           "face_materials"_a = nb::none(), "material"_a = kInheritMaterial,
           "attributes"_a = nb::dict(), "name"_a = "", "light_group"_a = "", "asset_length"_a = 0)
      .def("add_splats", &add_gaussian_splats, "positions"_a, "scales"_a, "orientations"_a,
           "opacities"_a, "harmonics"_a, nb::kw_only(), "material"_a, "name"_a = "",
           "light_group"_a = "", "asset_length"_a = 0)
      .def("add_instances", &add_instances, "parent"_a, "child"_a, "transforms"_a,
           "materials"_a = nb::none(), nb::kw_only(), "names"_a = nb::none(),
           "numbers"_a = nb::none(), "asset_lengths"_a = nb::none(), "motion"_a = nb::none());
}
