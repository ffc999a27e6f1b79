// SPDX-License-Identifier: Apache-2.0
#include <nanobind/ndarray.h>
#include <nanobind/stl/array.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

#include <optional>

#include "bind.h"
#include "wavecomb/core/error.h"
#include "wavecomb/geometry/tessellation/ears.h"
#include "wavecomb/geometry/tessellation/plain_mesh.h"
#include "wavecomb/geometry/tessellation/quads.h"
#include "wavecomb/geometry/tessellation/screen_size.h"
#include "wavecomb/geometry/tessellation/tessellation.h"
#include "wavecomb/scene/parallel.h"
#include "wavecomb/scene/scene.h"

namespace nb = nanobind;
using namespace wavecomb;

namespace {

template <typename T>
using Array = nb::ndarray<const T, nb::c_contig, nb::device::cpu>;

/// Returns the array `d[key]`, which `d` keeps alive, or an empty span if the key is missing.
template <typename T>
std::span<const T> span_of(const nb::dict& d, const char* key) {
  if (!d.contains(key) || d[key].is_none()) return {};
  const auto array = nb::cast<Array<T>>(d[key]);
  return {array.data(), array.size()};
}

template <typename Enum>
Enum rule_of(const nb::dict& d, const char* key, std::initializer_list<const char*> names) {
  const auto value = nb::cast<std::string>(d[key]);
  size_t i = 0;
  for (const char* name : names) {
    if (value == name) return static_cast<Enum>(i);
    ++i;
  }
  throw Error(std::string(key) + " is '" + value + "', which is not a known rule");
}

SurfacePrimvar primvar_of(const nb::dict& d, uint32_t width, Cage& cage) {
  SurfacePrimvar primvar;
  primvar.width = width;
  primvar.kind =
      rule_of<PrimvarKind>(d, "interpolation", {"none", "vertex", "varying", "faceVarying"});
  primvar.values = span_of<float>(d, "values");
  if (primvar.kind == PrimvarKind::kFaceVarying) {
    primvar.channel = static_cast<uint32_t>(cage.channels.size());
    cage.channels.push_back(
        {span_of<int32_t>(d, "indices"), static_cast<uint32_t>(primvar.values.size() / width)});
  }
  return primvar;
}

SurfaceDesc describe(const SceneBuilder& builder, const nb::dict& d) {
  SurfaceDesc desc;
  desc.level = nb::cast<uint32_t>(d["level"]);
  desc.points = span_of<float>(d, "points");
  Cage& cage = desc.cage;
  cage.vertex_count = static_cast<uint32_t>(desc.points.size() / 3);
  cage.face_sizes = span_of<int32_t>(d, "counts");
  cage.corners = span_of<int32_t>(d, "indices");
  if (desc.level > 0) {
    cage.scheme = rule_of<Scheme>(d, "scheme", {"catmullClark", "loop", "bilinear"});
    cage.boundary = rule_of<BoundaryRule>(d, "boundary", {"none", "edgeOnly", "edgeAndCorner"});
    cage.face_varying = rule_of<FaceVaryingRule>(
        d, "face_varying",
        {"none", "cornersOnly", "cornersPlus1", "cornersPlus2", "boundaries", "all"});
    cage.smooth_triangles = nb::cast<bool>(d["smooth_triangles"]);
    cage.holes = span_of<int32_t>(d, "holes");
    cage.crease_edges = span_of<int32_t>(d, "crease_edges");
    cage.crease_sharpness = span_of<float>(d, "crease_sharpness");
    cage.corner_vertices = span_of<int32_t>(d, "corner_vertices");
    cage.corner_sharpness = span_of<float>(d, "corner_sharpness");
  }
  desc.triangles = span_of<uint32_t>(d, "triangles");
  desc.triangle_faces = span_of<uint32_t>(d, "triangle_faces");
  desc.triangle_corners = span_of<uint32_t>(d, "triangle_corners");
  if (d.contains("uvs") && !d["uvs"].is_none())
    desc.uvs = primvar_of(nb::cast<nb::dict>(d["uvs"]), 2, cage);
  if (d.contains("primvars"))
    for (const nb::handle item : nb::cast<nb::list>(d["primvars"])) {
      const auto primvar = nb::cast<nb::dict>(item);
      desc.primvars.push_back(primvar_of(primvar, nb::cast<uint32_t>(primvar["width"]), cage));
    }
  if (d.contains("displacements"))
    for (const nb::handle item : nb::cast<nb::list>(d["displacements"])) {
      Displacement displacement;
      if (nb::isinstance<nb::dict>(item)) {
        displacement.use = texture_use(nb::cast<nb::dict>(item));
        displacement.texture = &builder.texture(displacement.use.texture).view();
      } else {
        displacement.constant = nb::cast<float>(item);
      }
      desc.displacements.push_back(displacement);
    }
  desc.face_displacement = span_of<int32_t>(d, "face_displacement");
  if (d.contains("matrix")) {
    const auto matrix = span_of<double>(d, "matrix");
    if (matrix.size() != 16) throw Error("a transform must be 4 x 4");
    std::copy(matrix.begin(), matrix.end(), desc.matrix.begin());
  }
  desc.left_handed = nb::cast<bool>(d["left_handed"]);
  return desc;
}

/// Moves a vector into a NumPy array of shape (size / columns, columns), or into a one-dimensional
/// array if `columns` is 0, without copying the data.
template <typename T>
nb::object array_of(std::vector<T>&& values, size_t columns) {
  auto* held = new std::vector<T>(std::move(values));
  const nb::capsule owner(held, [](void* p) noexcept { delete static_cast<std::vector<T>*>(p); });
  using NumpyArray = nb::ndarray<nb::numpy, T>;
  if (columns == 0) return nb::cast(NumpyArray(held->data(), {held->size()}, owner));
  return nb::cast(NumpyArray(held->data(), {held->size() / columns, columns}, owner));
}

}  // namespace

nb::list make_surfaces(const SceneBuilder& builder, const nb::list& descriptions,
                       uint32_t threads) {
  std::vector<SurfaceDesc> descs;
  std::vector<std::string> errors(nb::len(descriptions));
  for (const nb::handle item : descriptions) {
    try {
      descs.push_back(describe(builder, nb::cast<nb::dict>(item)));
    } catch (const Error& error) {
      errors[descs.size()] = error.what();
      descs.emplace_back();
    }
  }
  std::vector<SurfaceMesh> meshes(descs.size());
  {
    const nb::gil_scoped_release release;
    with_threads(threads, [&] {
      parallel_for(descs.size(), [&](size_t i) {
        if (!errors[i].empty()) return;
        try {
          meshes[i] = make_surface(descs[i]);
        } catch (const Error& error) {
          errors[i] = error.what();
        } catch (const std::bad_alloc&) {
          errors[i] = "out of memory";
        }
      });
    });
  }
  nb::list out;
  for (size_t i = 0; i < meshes.size(); ++i) {
    if (!errors[i].empty()) {
      out.append(errors[i]);
      continue;
    }
    SurfaceMesh& mesh = meshes[i];
    nb::dict d;
    d["positions"] = array_of(std::move(mesh.positions), 3);
    d["normals"] = array_of(std::move(mesh.normals), 3);
    d["uvs"] = mesh.uvs.empty() ? nb::none() : array_of(std::move(mesh.uvs), 2);
    d["triangles"] = array_of(std::move(mesh.triangles), 3);
    d["faces"] = array_of(std::move(mesh.faces), 0);
    nb::list primvars;
    for (size_t p = 0; p < mesh.primvars.size(); ++p) {
      SurfaceValues& made = mesh.primvars[p];
      primvars.append(nb::make_tuple(made.per_corner ? "corner" : "vertex",
                                     array_of(std::move(made.values), descs[i].primvars[p].width)));
    }
    d["primvars"] = primvars;
    d["manifold"] = mesh.is_manifold;
    out.append(d);
  }
  return out;
}

namespace {

double pixels(const Array<float>& points, const Array<int32_t>& counts,
              const Array<int32_t>& indices, const Array<double>& transforms,
              const Array<double>& to_camera, const std::array<double, 2>& centre,
              const std::array<double, 2>& half, double pixels_per_unit,
              const std::string& projection) {
  if (transforms.ndim() != 3 || transforms.shape(1) != 4 || transforms.shape(2) != 4 ||
      to_camera.size() != 16)
    throw Error("transforms must have the shape (k, 4, 4)");
  ScreenView view;
  std::copy_n(to_camera.data(), 16, view.to_camera.begin());
  std::copy_n(centre.begin(), 2, view.centre);
  std::copy_n(half.begin(), 2, view.half);
  view.pixels = pixels_per_unit;
  view.is_parallel = projection == "orthographic";
  view.is_all_round = projection == "latlong";
  const nb::gil_scoped_release release;
  double most = 0;
  for (size_t i = 0; i < transforms.shape(0); ++i)
    most = std::max(
        most, edge_pixels({points.data(), points.size()}, {counts.data(), counts.size()},
                          {indices.data(), indices.size()}, transforms.data() + 16 * i, view));
  return most;
}

nb::object quads(const Array<float>& points, const Array<int32_t>& indices,
                 const std::optional<Array<int64_t>>& starts) {
  const std::span<const int64_t> first =
      starts ? std::span(starts->data(), starts->size()) : std::span<const int64_t>();
  return array_of(
      split_quads({points.data(), points.size()}, {indices.data(), indices.size()}, first), 3);
}

/// Arrays with at least this many values are processed without the GIL. For smaller arrays,
/// releasing the GIL takes longer than the work.
constexpr size_t kMinParallelSize = 1 << 15;

/// Returns bounds as an array of shape (2, 3).
nb::object box_of(const PointBounds& bounds) {
  std::vector<float> box;
  for (const auto& row : bounds) box.insert(box.end(), row.begin(), row.end());
  return array_of(std::move(box), 3);
}

/// Returns the number of corners per face, the transformed points and their bounds, and the result
/// of `split_quads` if the faces are quads. Returns None if the mesh needs the general mesh loader.
nb::object plain_mesh(const Array<float>& points, const Array<int32_t>& counts,
                      const Array<int32_t>& indices, const Array<double>& matrix, double limit) {
  if (points.ndim() != 2 || points.shape(1) != 3) throw Error("points must have the shape (n, 3)");
  if (matrix.size() != 16) throw Error("a matrix must have the shape (4, 4)");
  std::optional<PlainMesh> mesh;
  {
    std::optional<nb::gil_scoped_release> release;
    if (points.size() >= kMinParallelSize) release.emplace();
    mesh = make_plain_mesh({points.data(), points.size()}, {counts.data(), counts.size()},
                           {indices.data(), indices.size()},
                           std::span<const double, 16>(matrix.data(), 16), limit);
  }
  if (!mesh) return nb::none();
  nb::object positions = nb::none(), quads = nb::none(), faces = nb::none();
  if (!mesh->positions.empty()) positions = array_of(std::move(mesh->positions), 3);
  if (mesh->corners_per_face == 4)
    quads = array_of(std::move(mesh->split), 3), faces = array_of(std::move(mesh->triangles), 3);
  return nb::make_tuple(mesh->corners_per_face, positions, box_of(mesh->bounds), quads, faces);
}

/// Returns positions, triangles, triangle counts, bounds, and whether all points are used, of the
/// meshes up to the first one that is not plain.
nb::tuple plain_meshes(const Array<float>& points, const Array<int32_t>& counts,
                       const Array<int32_t>& indices, const Array<uint32_t>& sizes,
                       const Array<double>& matrices, double limit) {
  if (sizes.ndim() != 2 || sizes.shape(1) != 3 || matrices.size() != 16 * sizes.shape(0))
    throw Error("sizes must have the shape (k, 3), and matrices the shape (k, 4, 4)");
  std::vector<MeshSizes> each;
  size_t ends[3] = {};
  for (size_t i = 0; i < sizes.shape(0); ++i) {
    const uint32_t* size = sizes.data() + 3 * i;
    each.push_back({size[0], size[1], size[2]});
    for (size_t k = 0; k < 3; ++k) ends[k] += size[k];
  }
  if (points.size() != 3 * ends[0] || counts.size() != ends[1] || indices.size() != ends[2])
    throw Error("the sizes of the meshes do not match their arrays");
  PlainMeshes meshes;
  {
    const nb::gil_scoped_release release;
    meshes = make_plain_meshes({points.data(), points.size()}, {counts.data(), counts.size()},
                               {indices.data(), indices.size()}, each,
                               {matrices.data(), matrices.size()}, limit);
  }
  std::vector<float> boxes;
  for (const PointBounds& bounds : meshes.bounds)
    for (const auto& row : bounds) boxes.insert(boxes.end(), row.begin(), row.end());
  return nb::make_tuple(
      array_of(std::move(meshes.positions), 3), array_of(std::move(meshes.triangles), 3),
      array_of(std::move(meshes.triangle_counts), 0), array_of(std::move(boxes), 3),
      array_of(std::move(meshes.uses_all_points), 0));
}

/// Returns the transformed points, normals and bounds of a shape. Returns None if a transformed
/// point is not finite or its coordinates exceed `limit`.
nb::object transform_shape(const Array<float>& points, const Array<float>& normals,
                           const Array<double>& matrix, const Array<double>& inverse,
                           double limit) {
  if (points.ndim() != 2 || points.shape(1) != 3 || normals.size() != points.size())
    throw Error("points and normals must have the shape (n, 3)");
  if (matrix.size() != 16 || inverse.size() != 16)
    throw Error("a matrix must have the shape (4, 4)");
  std::vector<float> transformed(points.size()), turned(points.size());
  bake_points({points.data(), points.size()}, std::span<const double, 16>(matrix.data(), 16),
              transformed);
  bake_normals({normals.data(), normals.size()}, std::span<const double, 16>(inverse.data(), 16),
               turned);
  const std::optional<PointBounds> bounds = bounds_of(transformed, limit);
  if (!bounds) return nb::none();
  return nb::make_tuple(array_of(std::move(transformed), 3), array_of(std::move(turned), 3),
                        box_of(*bounds));
}

/// Returns an array that states for each point whether a triangle uses it, or None if triangles use
/// all points.
nb::object used_points(const Array<uint32_t>& triangles, size_t point_count) {
  std::vector<uint8_t> used(point_count, 0);
  size_t found = 0;
  {
    std::optional<nb::gil_scoped_release> release;
    if (triangles.size() >= kMinParallelSize) release.emplace();
    found = mark_used_points({triangles.data(), triangles.size()}, used);
  }
  if (found == point_count) return nb::none();
  auto* held = new std::vector<uint8_t>(std::move(used));
  const nb::capsule owner(held,
                          [](void* p) noexcept { delete static_cast<std::vector<uint8_t>*>(p); });
  using NumpyArray = nb::ndarray<nb::numpy, bool>;
  return nb::cast(NumpyArray(reinterpret_cast<bool*>(held->data()), {held->size()}, owner));
}

nb::tuple triangulate_polygon(const Array<double>& corners, uint64_t max_steps) {
  if (corners.ndim() != 2 || corners.shape(1) != 2)
    throw Error("corners must have the shape (k, 2)");
  PolygonTriangulation found;
  {
    const nb::gil_scoped_release release;
    found = clip_ears({corners.data(), corners.size()}, max_steps);
  }
  return nb::make_tuple(array_of(std::move(found.corners), 3), found.untested);
}

nb::tuple weld(const Array<int32_t>& corners, uint32_t point_count, const Array<float>& values) {
  if (values.ndim() != 2) throw Error("values must have the shape (corners, width)");
  Welded welded;
  {
    const nb::gil_scoped_release release;
    welded = weld_corners({corners.data(), corners.size()}, point_count,
                          {values.data(), values.size()}, static_cast<uint32_t>(values.shape(1)));
  }
  return nb::make_tuple(array_of(std::move(welded.indices), 0),
                        array_of(std::move(welded.values), values.shape(1)));
}

}  // namespace

void bind_geometry(nb::module_& m) {
  using namespace nb::literals;
  m.attr("MAX_SUBDIVISION") = Subdivision::kMaxLevel;
  m.def("edge_pixels", &pixels, "points"_a, "counts"_a, "indices"_a, "transforms"_a, "to_camera"_a,
        "centre"_a, "half"_a, "pixels_per_unit"_a, "projection"_a = "perspective");
  m.def("split_quads", &quads, "points"_a, "indices"_a, "starts"_a = nb::none());
  m.def("plain_mesh", &plain_mesh, "points"_a, "counts"_a, "indices"_a, "matrix"_a, nb::kw_only(),
        "limit"_a);
  m.def("plain_meshes", &plain_meshes, "points"_a, "counts"_a, "indices"_a, "sizes"_a, "matrices"_a,
        nb::kw_only(), "limit"_a);
  m.def("place_shape", &transform_shape, "points"_a, "normals"_a, "matrix"_a, "inverse"_a,
        nb::kw_only(), "limit"_a);
  m.def("used_points", &used_points, "triangles"_a, "point_count"_a);
  m.def("clip_ears", &triangulate_polygon, "corners"_a, "most_steps"_a = kMaxClippingSteps);
  m.def("weld_corners", &weld, "corners"_a, "point_count"_a, "values"_a);
}
