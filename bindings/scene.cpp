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

#include "arguments.h"
#include "bind.h"
#include "camera.h"
#include "lights.h"
#include "scene_values.h"
#include "statistics.h"
#include "wavecomb/core/error.h"
#include "wavecomb/light/description/light_table.h"
#include "wavecomb/scene/fingerprint.h"
#include "wavecomb/scene/object_bounds.h"
#include "wavecomb/scene/scene.h"
#include "wavecomb/texture/tile_store.h"

namespace nb = nanobind;
using namespace wavecomb;

namespace {

uint32_t add_geometry_set(SceneBuilder& builder, const std::map<std::string, std::string>& rules) {
  GeometrySet set;
  for (const auto& [path, rule] : rules)
    set.entries.push_back({path, choose<PathRule>("rule", rule,
                                                  {{"exclude", PathRule::kExclude},
                                                   {"explicit", PathRule::kExplicit},
                                                   {"expand", PathRule::kExpand}})});
  return builder.add_geometry_set(std::move(set));
}

void add_visibility(SceneBuilder& builder, const std::string& path,
                    const std::map<std::string, bool>& rays) {
  VisibilityRule rule{path};
  for (const auto& [name, value] : rays) {
    const uint32_t bit = choose<uint32_t>("kind of rays", name,
                                          {{"camera", kVisibleToCamera},
                                           {"shadow", kVisibleToShadowRays},
                                           {"bounces", kVisibleToBounces},
                                           {"holdout", kHoldout}});
    rule.specified |= bit;
    if (value) rule.bits |= bit;
  }
  builder.add_visibility(std::move(rule));
}

uint32_t add_ies(SceneBuilder& builder, std::vector<float> vertical, std::vector<float> horizontal,
                 const Array<float>& candela) {
  IesProfile profile{std::move(vertical), std::move(horizontal), {}};
  profile.candela.assign(candela.data(), candela.data() + candela.size());
  return builder.add_ies(std::move(profile));
}

/// Returns the lower and upper corner of a bounding box.
std::pair<Color3, Color3> corners(const Bounds& b) {
  return {Color3{b.lo.x, b.lo.y, b.lo.z}, Color3{b.hi.x, b.hi.y, b.hi.z}};
}

}  // namespace

void bind_scene(nb::module_& m) {
  using namespace nb::literals;
  m.def("material_table", &material_rows);
  m.def("program_table", &program_rows);
  m.attr("INHERIT_MATERIAL") = kInheritMaterial;

  nb::class_<TileStore>(m, "TextureStore")
      .def(nb::init<uint64_t, std::string>(), "limit_bytes"_a, "folder"_a)
      .def_static("obstacle", &UserFaults::unsupported_reason)
      .def_prop_ro("limit_bytes", &TileStore::limit_bytes)
      .def("set_waiting", &TileStore::set_waiting, "bytes"_a)
      .def_prop_ro("statistics",
                   [](const TileStore& store) { return texture_store_dict(store.statistics()); });

  nb::class_<Scene>(m, "Scene")
      .def_prop_ro("triangles", &Scene::unique_triangles)
      .def_prop_ro("instanced_triangles", &Scene::instanced_triangles)
      .def_prop_ro("curve_segments", &Scene::curve_segments)
      .def_prop_ro("points", &Scene::points)
      .def_prop_ro("splats", &Scene::splats)
      .def_prop_ro("mesh_count", [](const Scene& s) { return s.meshes().size(); })
      .def_prop_ro("instance_count", [](const Scene& s) { return s.instances().size(); })
      .def_prop_ro("volumes",
                   [](const Scene& s) {
                     std::vector<std::string> out;
                     for (const Volume& volume : s.volumes()) out.push_back(volume.name);
                     return out;
                   })
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
      .def_prop_ro("bounds", [](const Scene& s) { return corners(s.bounds()); })
      .def(
          "bounds_of",
          [](const Scene& s, const std::string& prim) {
            const Bounds b = object_bounds(s, prim);
            return b.empty() ? std::nullopt : std::optional(corners(b));
          },
          "prim"_a, nb::call_guard<nb::gil_scoped_release>());

  nb::class_<SceneBuilder> builder(m, "SceneBuilder");
  builder
      .def(nb::init<uint32_t, std::shared_ptr<TileStore>>(), "threads"_a = 0,
           "store"_a.none() = nb::none())
      .def("make_surfaces", &make_surfaces, "descriptions"_a, "threads"_a = 0)
      .def("add_group", &SceneBuilder::add_group, "name"_a = "", "root"_a = "")
      .def("add_to_group", &SceneBuilder::add_to_group, "group"_a, "mesh"_a)
      .def("add_light", &add_light, "kind"_a, "transform"_a, "values"_a)
      .def("add_mesh_light", &add_mesh_light, "transform"_a, "material_sync"_a, "values"_a)
      .def("add_geometry_set", &add_geometry_set, "rules"_a)
      .def("add_visibility", &add_visibility, "path"_a, "rays"_a)
      .def("add_ies", &add_ies, "vertical"_a, "horizontal"_a, "candela"_a)
      .def("add_light_filter", &add_light_filter, "transform"_a, "distance"_a, "sides"_a,
           "picture_u"_a, "picture_v"_a, "texture"_a.none(), "decay"_a, "density"_a,
           "next"_a.none())
      .def("set_camera", &set_camera, "transform"_a, "values"_a)
      .def("build", &SceneBuilder::build, nb::call_guard<nb::gil_scoped_release>());
  def_materials(builder);
  def_meshes(builder);
  def_volumes(builder);
}
