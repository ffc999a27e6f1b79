// SPDX-License-Identifier: Apache-2.0
// What shading a record costs: by program and lane width, with full packets and with packets filled
// to 35 %, as arrival order fills packets of 16 on the Mixed stage. Hit set-up, material, light
// sample, bounce and roulette, as in a wave; synthetic hits (time_material), a rect light.
#include "wave_testing.h"
#include "widths.h"

namespace wavecomb::micro {
namespace {

using namespace scene_testing;

constexpr uint32_t kRecords = 4096;
constexpr uint32_t kEdge = 1024;  // of the texture

/// A sphere of one material under a lamp.
ScenePtr make_scene(ProgramId program, bool textured) {
  SceneBuilder b;
  Material material = make_material(program, {0.6f, 0.5f, 0.4f}, 0.4f);
  if (program == ProgramId::kEmissive) material.emission = {1, 1, 1};
  if (textured)
    material.textures[static_cast<size_t>(Input::kBaseColor)] =
        use(add_texture(b, kEdge, kEdge, 3, random_texels(kEdge * kEdge * 3, 0.2f, 0.8f, 1)));
  const uint32_t id = b.add_material(material);
  b.add_to_group(0, b.add_mesh(make_mesh(sphere(32, true), id)));
  Light light = make_light(LightKind::kRect, {12, 11, 9}, translate(0, 3, 0) * rotate(0, -90));
  b.add_light(light);
  b.set_camera(make_camera({0, 0, 4}, {0, 0, 0}));
  return b.build();
}

template <size_t W>
void shade(benchmark::State& state, ProgramId program, bool textured, float fill) {
  const ScenePtr scene = make_scene(program, textured);
  CalibrationHits hits = find_calibration_hits(*scene).front();
  hits.count = kRecords;
  hits.fill = fill;
  Settings settings;
  settings.policy = "none";
  wave_testing::WaveRun run(scene, {settings, W, 1});
  for (auto _ : state) state.SetIterationTime(1e-9 * run.time_material<W>(hits));
  count_items(state, "record", kRecords);
}

const bool registered = [] {
  for (uint32_t p = 0; p < kProgramCount; ++p)
    for (const bool textured : {false, true})
      for (const float fill : {1.f, 0.35f})
        for_each_width([&]<size_t W>() {
          const auto program = static_cast<ProgramId>(p);
          // Emission is read from no base colour; a lone lane is always full.
          if ((textured && program == ProgramId::kEmissive) || (fill < 1 && W == 1)) return;
          const std::string name = "shade/" + std::string(kProgramNames[p]) +
                                   (textured ? "/textured" : "") +
                                   (fill < 1 ? "/full:35%" : "/full:100%") + lanes_label(W);
          benchmark::RegisterBenchmark(name.c_str(), shade<W>, program, textured, fill)
              ->UseManualTime()
              ->Unit(benchmark::kMicrosecond);
        });
  return true;
}();

}  // namespace
}  // namespace wavecomb::micro
