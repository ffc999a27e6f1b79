// SPDX-License-Identifier: Apache-2.0
/// Bindings of voxel grids, and of the methods of SceneBuilder that add volumes.
#include <nanobind/ndarray.h>
#include <nanobind/stl/array.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/shared_ptr.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/tuple.h>

#include "arguments.h"
#include "bind.h"
#include "scene_values.h"
#include "wavecomb/medium/description/subsurface.h"
#include "wavecomb/scene/parallel.h"
#include "wavecomb/scene/scene.h"

namespace nb = nanobind;
using namespace wavecomb;

namespace {

using AnyArray = nb::ndarray<nb::c_contig, nb::device::cpu, nb::ro>;

/// Voxel grid with its transform to the volume's object space.
struct TransformedVoxels {
  VolumeField field;
};

TransformedVoxels make_grid(const Array<int32_t>& origins, const AnyArray& values,
                            const AnyArray& index_to_object, float background,
                            const std::string& name, bool is_signed) {
  const size_t n = values.ndim() > 0 ? values.shape(0) : 0;
  const bool is_single = values.ndim() == 4, is_colour = values.ndim() == 5 && values.shape(4) == 3;
  bool fits = origins.ndim() == 2 && origins.shape(1) == 3 && origins.shape(0) == n &&
              (is_single || is_colour);
  for (size_t k = 1; k < 4 && fits; ++k) fits = values.shape(k) == kBrickEdge;
  if (!fits)
    throw Error(
        "grid '" + name +
        "' needs origins of shape (n, 3) and values of shape (n, 8, 8, 8) or (n, 8, 8, 8, 3)");
  GridBricks bricks;
  bricks.name = name;
  bricks.origins = {origins.data(), origins.size()};
  bricks.components = is_colour ? 3 : 1;
  bricks.background = background;
  bricks.is_signed = is_signed;
  const bool is_half = values.dtype().code == static_cast<uint8_t>(nb::dlpack::dtype_code::Float) &&
                       values.dtype().bits == 16;
  if (is_half)
    bricks.halves = {static_cast<const uint16_t*>(values.data()), values.size()};
  else if (values.dtype() == nb::dtype<float>())
    bricks.floats = {static_cast<const float*>(values.data()), values.size()};
  else
    throw Error("grid '" + name + "' needs values of float16 or float32");
  const Affine map = affine(index_to_object);
  const nb::gil_scoped_release release;
  TransformedVoxels grid;
  with_threads(0, [&] { grid.field.grid = std::make_shared<const VolumeGrid>(bricks); });
  grid.field.index_to_object = map;
  return grid;
}

using Corners = std::tuple<Color3, Color3>;

uint32_t add_volume(SceneBuilder& builder, const AnyArray& to_world,
                    const std::optional<TransformedVoxels>& density,
                    const std::optional<TransformedVoxels>& color,
                    const std::optional<TransformedVoxels>& emission_grid,
                    const std::optional<TransformedVoxels>& velocity,
                    const std::array<float, 2>& seconds, const std::optional<Corners>& bounds,
                    const Color3& extinction, const Color3& albedo, const Color3& emission,
                    float anisotropy, const std::string& name) {
  Volume v;
  v.name = name;
  if (density) v.density = density->field;
  if (color) v.color = color->field;
  if (emission_grid) v.glow = emission_grid->field;
  if (velocity) v.velocity = velocity->field;
  v.seconds = seconds;
  if (bounds) v.box = {vec3(std::get<0>(*bounds)), vec3(std::get<1>(*bounds))};
  v.to_world = affine(to_world);
  v.extinction = vec3(extinction);
  v.albedo = vec3(albedo);
  v.emission = vec3(emission);
  v.anisotropy = anisotropy;
  if (!v.moves()) return builder.add_volume(std::move(v));
  const nb::gil_scoped_release release;
  uint32_t number = 0;
  with_threads(0, [&] { number = builder.add_volume(std::move(v)); });
  return number;
}

}  // namespace

void bind_volumes(nb::module_& m) {
  using namespace nb::literals;
  nb::class_<TransformedVoxels>(m, "VolumeGrid")
      .def(nb::new_(&make_grid), "origins"_a, "values"_a, "index_to_object"_a, "background"_a = 0.f,
           "name"_a = "", "is_signed"_a = false)
      .def_prop_ro("bricks", [](const TransformedVoxels& g) { return g.field.grid->brick_count(); })
      .def_prop_ro("bytes", [](const TransformedVoxels& g) { return g.field.grid->bytes(); });
  m.def("walk_albedo", &single_albedo, "color"_a, "anisotropy"_a);
}

void def_volumes(nb::class_<SceneBuilder>& builder) {
  using namespace nb::literals;
  builder.def("add_volume", &add_volume, "to_world"_a, nb::kw_only(), "density"_a = nb::none(),
              "color"_a = nb::none(), "emission_grid"_a = nb::none(), "velocity"_a = nb::none(),
              "seconds"_a = std::array<float, 2>{0.f, 0.f}, "bounds"_a = nb::none(),
              "extinction"_a = Color3{1.f, 1.f, 1.f}, "albedo"_a = Color3{0.5f, 0.5f, 0.5f},
              "emission"_a = Color3{0.f, 0.f, 0.f}, "anisotropy"_a = 0.f, "name"_a = "");
}
