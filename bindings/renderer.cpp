// SPDX-License-Identifier: Apache-2.0
/// Bindings of class wavecomb._core.Renderer.
#include "wavecomb/render/renderer.h"
#include "wavecomb/render/inspection/learned_lookup.h"
#include "wavecomb/render/inspection/picking.h"
#include "wavecomb/render/snapshot.h"
#include "wavecomb/render/statistics/cost_profile.h"
#include "wavecomb/render/statistics/render_statistics.h"
#include "wavecomb/scene/scene.h"
#include "wavecomb/schedule/policy.h"

#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>
#include <nanobind/stl/shared_ptr.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/unique_ptr.h>

#include "bind.h"
#include "rendering.h"
#include "scene_values.h"

namespace nb = nanobind;
using namespace nb::literals;
using namespace wavecomb;

namespace {

Result render(WavefrontRenderer& renderer, nb::handle settings, const nb::object& progress,
              const nb::object& policy, const nb::object& costs, const nb::object& watcher,
              const nb::object& state, double interval, bool image, const nb::object& learned) {
  return run_render(
      [&](const Settings&) -> WavefrontRenderer& { return renderer; }, *renderer.scene(),
      {settings, progress, policy, costs, nullptr, watcher, state, interval, image, learned});
}

void edit(WavefrontRenderer& renderer, const nb::object& camera, const nb::dict& materials,
          const nb::dict& lights, const nb::dict& moves) {
  const SceneEdit change = scene_edit(*renderer.scene(), camera, materials, lights, moves);
  const nb::gil_scoped_release release;
  renderer.edit(change);
}

/// Calls `work` without the GIL and returns its result.
template <typename Work>
auto without_gil(const Work& work) {
  const nb::gil_scoped_release release;
  return work();
}

nb::object pick_at(const WavefrontRenderer& renderer, float x, float y, uint32_t width,
                   uint32_t height) {
  const std::optional<Pick> found = without_gil([&] { return renderer.pick(x, y, width, height); });
  if (!found) return nb::none();
  const auto triple = [](const Vec3<float>& v) { return nb::make_tuple(v.x, v.y, v.z); };
  nb::dict d;
  d["object"] = found->object;
  d["asset"] = found->asset;
  d["position"] = triple(found->position);
  d["depth"] = found->depth;
  d["distance"] = found->distance;
  if (found->light != kNoLight) {
    d["light"] = found->light;
    return d;
  }
  d["material"] = found->material;
  d["material_name"] = renderer.scene()->materials()[found->material].name;
  d["instance"] = found->instance + 1;
  d["normal"] = triple(found->normal);
  d["uv"] = nb::make_tuple(found->uv.x, found->uv.y);
  return d;
}

nb::object learned_at(const WavefrontRenderer& renderer, float x, float y, uint32_t width,
                      uint32_t height) {
  std::optional<LearnedData> found =
      without_gil([&] { return renderer.learned(x, y, width, height); });
  if (!found) return nb::none();
  static constexpr const char* kAxes[kGuidingAxes] = {"+x", "-x", "+y", "-y", "+z", "-z"};
  nb::dict d;
  d["axis"] = kAxes[found->axis];
  d["density"] = nb::none();
  if (found->known) {
    auto* own = new std::vector<float>(std::move(found->density));
    const nb::capsule owner(own,
                            [](void* p) noexcept { delete static_cast<std::vector<float>*>(p); });
    const size_t shape[2] = {kGuidingSide, kGuidingSide};
    d["density"] = nb::cast(nb::ndarray<nb::numpy, float>(own->data(), 2, shape, owner));
    d["guided_share"] = found->guided_share;
    d["survival"] = found->survival;
  }
  nb::list lights;
  for (const auto& [name, share] : found->light_shares) lights.append(nb::make_tuple(name, share));
  d["light_shares"] = lights;
  return d;
}

}  // namespace

void bind_renderer(nb::module_& m) {
  nb::class_<WavefrontRenderer>(m, "Renderer")
      .def(nb::init<std::shared_ptr<const Scene>, uint32_t>(), "scene"_a, "threads"_a = 0,
           nb::call_guard<nb::gil_scoped_release>())
      .def_prop_ro("scene", &WavefrontRenderer::scene)
      .def_prop_ro("version", &WavefrontRenderer::version)
      .def("edit", &edit, nb::kw_only(), "camera"_a = nb::none(), "materials"_a = nb::dict(),
           "lights"_a = nb::dict(), "moves"_a = nb::dict())
      .def("render", &render, "settings"_a, "progress"_a = nb::none(), "policy"_a = nb::none(),
           "costs"_a = nb::none(), "watcher"_a = nb::none(), "state"_a = nb::none(),
           "interval"_a = 0.1, "picture"_a = true, "learned"_a = nb::none())
      .def("stop", &WavefrontRenderer::stop)
      .def("twin", &WavefrontRenderer::clone)
      .def("pick", &pick_at, "x"_a, "y"_a, "width"_a, "height"_a)
      .def("learned", &learned_at, "x"_a, "y"_a, "width"_a, "height"_a);
}
