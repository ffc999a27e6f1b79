// SPDX-License-Identifier: Apache-2.0
// Builds a scene and renders it: a plastic sphere on a floor under a square light.
//   cmake -S examples/cpp -B build/examples -DCMAKE_PREFIX_PATH=<where wavecomb is installed>
//   cmake --build build/examples && build/examples/example_render_sphere
#include <cmath>
#include <cstdio>
#include <vector>

#include "wavecomb/core/error.h"
#include "wavecomb/render/renderer.h"
#include "wavecomb/render/snapshot.h"
#include "wavecomb/render/statistics/render_statistics.h"
#include "wavecomb/scene/scene.h"

namespace wc = wavecomb;

int main() try {
  // A unit sphere of 64 x 32 quads, two triangles each. The sphere's normals equal its positions.
  constexpr uint32_t kAround = 64, kUp = 32;
  std::vector<float> points;
  std::vector<uint32_t> triangles;
  for (uint32_t j = 0; j <= kUp; ++j)
    for (uint32_t i = 0; i <= kAround; ++i) {
      const float theta = 3.14159265f * float(j) / kUp, phi = 6.28318531f * float(i) / kAround;
      points.insert(points.end(), {std::sin(theta) * std::cos(phi), std::cos(theta),
                                   -std::sin(theta) * std::sin(phi)});
      if (i == kAround || j == kUp) continue;
      const uint32_t a = j * (kAround + 1) + i, b = a + kAround + 1;
      triangles.insert(triangles.end(), {a, b, b + 1, a, b + 1, a + 1});
    }
  const std::vector<float> floor_points = {-8, -1, -8, -8, -1, 8, 8, -1, 8, 8, -1, -8};
  const std::vector<uint32_t> floor_triangles = {0, 1, 2, 0, 2, 3};

  wc::SceneBuilder builder;
  wc::Material red, grey;
  red.program = wc::ProgramId::kPlastic;
  red.base_color = {0.7f, 0.1f, 0.05f};
  red.roughness = 0.2f;
  grey.program = wc::ProgramId::kDiffuse;
  grey.base_color = {0.6f, 0.6f, 0.6f};
  const uint32_t red_id = builder.add_material(red), grey_id = builder.add_material(grey);
  // The scene does not copy the arrays, which must exist as long as the scene.
  builder.add_to_group(0, builder.add_mesh({.name = "sphere",
                                            .positions = points,
                                            .indices = triangles,
                                            .normals = points,
                                            .normals_at = wc::Attribute::kVertex,
                                            .material = red_id}));
  builder.add_to_group(0, builder.add_mesh({.name = "floor",
                                            .positions = floor_points,
                                            .indices = floor_triangles,
                                            .material = grey_id}));
  wc::Light lamp;  // a square that emits along its -z axis, rotated to face down from y = 4
  lamp.to_world = {{{1, 0, 0}, {0, 0, 1}, {0, -1, 0}}, {1, 4, 1}};
  lamp.width = lamp.height = 2;
  lamp.color = {12, 12, 12};
  builder.add_light(lamp);
  wc::Camera camera;
  camera.to_world.t = {0, 0, 6};
  builder.set_camera(camera);

  wc::WavefrontRenderer renderer(builder.build());
  wc::Settings settings;
  settings.width = settings.height = 256;
  settings.spp = 64;
  const wc::RenderedImage image = renderer.render(settings);
  std::FILE* file = std::fopen("sphere.ppm", "wb");
  if (!file) throw wc::Error("sphere.ppm cannot be written here; try another folder");
  std::fprintf(file, "P6 256 256 255\n");
  for (float x : image.beauty) std::fputc(int(255.f * std::pow(std::min(x, 1.f), 1 / 2.2f)), file);
  std::fclose(file);
  std::printf("sphere.ppm: %.1f million samples/s\n",
              1e-6 * double(renderer.statistics().samples) / renderer.statistics().render_s);
} catch (const wc::Error& error) {
  std::fprintf(stderr, "error: %s\n", error.what());
  return 2;
}
