// SPDX-License-Identifier: Apache-2.0
#include <nanobind/nanobind.h>
#include <nanobind/stl/array.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/shared_ptr.h>
#include <nanobind/stl/vector.h>

#include "bind.h"
#include "wavecomb/render/inspection/ray_recording.h"

namespace nb = nanobind;
using namespace nb::literals;
using namespace wavecomb;

namespace {

nb::dict replay(RayRecording& recording, bool alone, uint32_t threads,
                const std::array<uint32_t, kRayKinds>& width,
                const std::array<std::optional<bool>, kRayKinds>& coherent) {
  ReplayTimes times;
  {
    const nb::gil_scoped_release release;
    times = recording.replay({alone, threads, width, coherent, {true, true, true}});
  }
  nb::dict d;
  d["wall_s"] = times.wall_s;
  d["thread_s"] = times.thread_s;
  d["rays"] = times.rays;
  d["hits"] = times.hits;
  return d;
}

}  // namespace

void bind_recording(nb::module_& m) {
  nb::class_<RayRecording>(m, "RayRecording")
      .def(nb::init<std::shared_ptr<const Scene>, uint64_t>(), "scene"_a,
           "byte_limit"_a = uint64_t{4} << 30)
      .def_prop_ro("bytes", &RayRecording::bytes)
      .def_prop_ro("waves", &RayRecording::waves)
      .def_prop_ro("rays", &RayRecording::rays_at)
      .def_prop_ro("shadow_rays", &RayRecording::shadow_rays_at)
      .def("replay", &replay, nb::kw_only(), "alone"_a = true, "threads"_a = 0,
           "width"_a = std::array<uint32_t, kRayKinds>{16, 16, 16},
           "coherent"_a = std::array<std::optional<bool>, kRayKinds>{});
}
