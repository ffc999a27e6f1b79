// SPDX-License-Identifier: Apache-2.0 Cost of exact and watertight traversal. Embree traces rays
// recorded from a render with various build and traversal options.
//
//      micro_traversal_modes [ROUNDS]     prints the CPU time per ray in ns
#include <time.h>

#include <cstdio>
#include <cstdlib>
#include <memory>

#include "embree_modes.h"
#include "scene_testing.h"
#include "spheres.h"
#include "wavecomb/wave/ray_recorder.h"

namespace wavecomb::micro {
namespace {

using namespace scene_testing;

/// Records the bounce and shadow rays of a render in traversal order.
struct Kept final : RayRecorder {
  Rays bounce, shadow;
  void closest(const void*, const RaySpan& rays, uint32_t depth, bool) override {
    if (depth > 0) bounce.add(rays);
  }
  void occluded(const void*, const RaySpan& rays, uint32_t, bool) override { shadow.add(rays); }
};

constexpr Mode kModes[] = {
    {.name = "robust filter 16"},
    {.name = "robust filter 8", .width = 8},
    {.name = "robust filter 1", .width = 1},
    {.name = "robust - 16", .filter = false},
    {.name = "robust - 8", .filter = false, .width = 8},
    {.name = "robust - 1", .filter = false, .width = 1},
    {.name = "fast filter 16", .robust = false},
    {.name = "fast filter 8", .robust = false, .width = 8},
    {.name = "fast filter 1", .robust = false, .width = 1},
    {.name = "fast - 16", .robust = false, .filter = false},
    {.name = "fast - 8", .robust = false, .filter = false, .width = 8},
    {.name = "fast - 1", .robust = false, .filter = false, .width = 1},
    {.name = "robust filter 16, spatial splits", .quality = RTC_BUILD_QUALITY_HIGH},
    {.name = "robust filter 16, bvh4.triangle4v", .device = "tri_accel=bvh4.triangle4v"},
    {.name = "robust filter 16, bvh8.triangle4v", .device = "tri_accel=bvh8.triangle4v"},
    {.name = "robust filter 1, bvh4.triangle4v", .width = 1, .device = "tri_accel=bvh4.triangle4v"},
    {.name = "robust filter 16, one geometry", .merged = true},
    {.name = "robust filter 16, triangles only", .only_triangles = true},
    {.name = "robust filter 16, coherent", .coherent = true},
};

void time_modes(const char* name, const ScenePtr& scene, int rounds) {
  Kept kept;
  Settings settings;
  settings.width = settings.height = 128;
  settings.spp = 16;
  settings.threads = 1;
  WavefrontRenderer(scene).render(settings, {.recorder = &kept});
  std::vector<Soup> soups;
  for (uint32_t m : scene->geometry()->groups[0].meshes) {
    const Mesh& mesh = scene->geometry()->meshes[m];
    soups.push_back({{mesh.positions.begin(), mesh.positions.end()},
                     {mesh.indices.begin(), mesh.indices.end()}});
  }
  std::vector<std::unique_ptr<Built>> built;
  for (const Mode& mode : kModes) built.push_back(std::make_unique<Built>(soups, mode));
  for (const bool shadow : {false, true}) {
    const RaySpan rays = (shadow ? kept.shadow : kept.bounce).span();
    std::vector<std::vector<double>> ns(built.size());
    std::vector<size_t> hits(built.size());
    for (int round = -1; round < rounds; ++round)
      for (size_t k = 0; k < built.size(); ++k) {
        timespec a, b;
        clock_gettime(CLOCK_THREAD_CPUTIME_ID, &a);
        hits[k] = built[k]->trace(rays, shadow);
        clock_gettime(CLOCK_THREAD_CPUTIME_ID, &b);
        const double s = double(b.tv_sec - a.tv_sec) + 1e-9 * double(b.tv_nsec - a.tv_nsec);
        if (round >= 0) ns[k].push_back(1e9 * s / double(rays.size));
      }
    std::printf("%s, %s rays: %zu\n", name, shadow ? "shadow" : "bounce", rays.size);
    for (size_t k = 0; k < built.size(); ++k) {
      std::vector<double> ratio;
      for (int r = 0; r < rounds; ++r) ratio.push_back(ns[k][r] / ns[0][r]);
      std::ranges::sort(ratio);
      std::ranges::sort(ns[k]);
      std::printf("  %-36s %6.1f ns   %.2f (%.2f to %.2f)   %zu hits\n", built[k]->mode().name,
                  ns[k][rounds / 2], ratio[rounds / 2], ratio.front(), ratio.back(), hits[k]);
    }
    std::fflush(stdout);
  }
}

}  // namespace
}  // namespace wavecomb::micro

int main(int argc, char** argv) {
  using namespace wavecomb::micro;
  const int rounds = argc > 1 ? std::atoi(argv[1]) : 5;
  if (rounds < 1) {
    std::fprintf(stderr, "usage: micro_traversal_modes [ROUNDS]\n");
    return 2;
  }
  time_modes("Cornell", wavecomb::scene_testing::cornell(), rounds);
  time_modes("spheres", spheres(64), rounds);
  return 0;
}
