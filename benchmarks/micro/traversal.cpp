// SPDX-License-Identifier: Apache-2.0 Cost of tracing a ray. Rays recorded from a render are traced
// with Embree alone, and with the renderer's own traversal.
#include <map>

#include "scene_testing.h"
#include "spheres.h"
#include "wavecomb/render/inspection/ray_recording.h"
#include "widths.h"

namespace wavecomb::micro {
namespace {

using namespace scene_testing;

/// Makes a box scene of about 20 triangles, or of about a million triangles if `large`.
ScenePtr make_scene(bool large) {
  return large ? spheres(256) : cornell();
}

/// Returns the rays of a render with diffuse bounces, 128 x 128 pixels and 16 samples per pixel, in
/// the order of path slots or sorted by direction. The first call for a scene and order renders and
/// records them.
RayRecording& recording(bool large, RayOrder order) {
  static std::map<std::pair<bool, RayOrder>, std::unique_ptr<RayRecording>> made;
  auto& rays = made[{large, order}];
  if (!rays) {
    const ScenePtr scene = make_scene(large);
    rays = std::make_unique<RayRecording>(scene, uint64_t{2} << 30);
    Settings settings;
    settings.width = settings.height = 128;
    settings.spp = 16;
    settings.ray_order = settings.shadow_order = order;
    WavefrontRenderer(scene).render(settings, {.recorder = rays.get()});
  }
  return *rays;
}

void traversal(benchmark::State& state, bool large, RayOrder order, bool alone, uint32_t width,
               RayKind kind, bool coherent) {
  const auto k = static_cast<size_t>(kind);
  Replay how{alone, 1, {width, width, width}, {coherent, coherent, coherent}, {}};
  how.wanted[k] = true;
  ReplayTimes times;
  try {
    for (auto _ : state) {
      times = recording(large, order).replay(how);
      state.SetIterationTime(times.thread_s[k]);
    }
  } catch (const Error& error) {
    state.SkipWithError(error.what());  // this build of Embree does not support the width
    return;
  }
  count_items(state, "ray", times.rays[k]);
  state.counters["hit_share"] =
      static_cast<double>(times.hits[k]) / static_cast<double>(times.rays[k]);
}

const bool registered = [] {
  constexpr const char* kKinds[kRayKinds] = {"camera", "bounce", "shadow"};
  constexpr std::pair<RayOrder, const char*> kOrders[] = {{RayOrder::kSlot, "/slot_order"},
                                                          {RayOrder::kDirection, "/by_direction"}};
  for (const bool large : {false, true})
    for (size_t k = 0; k < kRayKinds; ++k)
      for (const auto& [order, order_name] : kOrders)
        for (const bool alone : {true, false})
          for (const uint32_t width : {1u, 4u, 8u, 16u})
            for (const bool coherent : {true, false}) {
              if (coherent && width == 1) continue;              // same as incoherent
              if (k == 0 && order != RayOrder::kSlot) continue;  // camera rays are not sorted
              const std::string name =
                  std::string("traversal/") + (large ? "2M_triangles/" : "box/") + kKinds[k] +
                  order_name + (alone ? "/embree_alone" : "/as_a_render") +
                  "/packet:" + std::to_string(width) + (coherent ? "/coherent" : "");
              benchmark::RegisterBenchmark(name.c_str(), traversal, large, order, alone, width,
                                           static_cast<RayKind>(k), coherent)
                  ->UseManualTime()
                  ->Unit(benchmark::kMillisecond);
            }
  return true;
}();

}  // namespace
}  // namespace wavecomb::micro
