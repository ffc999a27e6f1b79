// SPDX-License-Identifier: Apache-2.0 Cost of shading a queued hit, by shading program and lane
// width. Packets are full or filled to 35 %, which is the mean for packets of 16 unsorted hits of
// the Mixed scene. As in a render, shading includes the hit's surface data, the material, a light
// sample, a bounce and Russian roulette. The hits are synthetic (`time_material`), and the light is
// a rect light.
#include "wave_testing.h"
#include "widths.h"

namespace wavecomb::micro {
namespace {

using namespace scene_testing;

constexpr uint32_t kRecords = 4096;
constexpr uint32_t kEdge = 1024;  // width and height of the textures in texels

/// Textures and layers of a material. `textures` is 1 for a base colour map, 4 for roughness,
/// metallic (all zeros) and opacity (all ones) maps as well, and 5 for specular colour and normal
/// maps as well. If `odd` is true, one texel of each constant map differs, so that no map is
/// replaced by a constant.
struct Look {
  const char* name;
  uint32_t textures;
  void (*edit)(Material&) = nullptr;
  bool odd = false;
};
constexpr Look kLooks[] = {
    {"", 0},
    {"/textured", 1},
    {"/silent", 4},
    {"/silent:but-a-texel", 4, nullptr, true},
    {"/textures:5", 5},
    {"/coat", 0, [](Material& m) { m.clearcoat = 1; }},
    {"/coat/textures:5", 5, [](Material& m) { m.clearcoat = 1; }},
    {"/glow", 0, [](Material& m) { m.emission = {1, 1, 1}; }},
    {"/glass", 0,
     [](Material& m) {
       m.opacity = 0.2f;
       m.openpbr.transmission_weight = 0.8f;
     }},
};

/// Makes an 8-bit image.
TextureUse image(SceneBuilder& b, uint32_t channels, bool srgb, float low, float high) {
  std::vector<uint8_t> bytes;
  for (const float x : random_texels(kEdge * kEdge * channels, low, high, channels))
    bytes.push_back(static_cast<uint8_t>(x * 255.f));
  return use(b.add_texture({"image", bytes.data(), kEdge, kEdge, channels, TexelFormat::kU8, srgb,
                            Wrap::kRepeat, Wrap::kRepeat}));
}

/// Adds a texture with the same value in all texels. If `odd` is true, one texel has another value.
TextureUse silent(SceneBuilder& b, uint8_t value, bool odd) {
  std::vector<uint8_t> bytes(size_t{kEdge} * kEdge, value);
  if (odd) bytes.back() = 127;
  return use(b.add_texture({"silent", bytes.data(), kEdge, kEdge, 1, TexelFormat::kU8, false,
                            Wrap::kRepeat, Wrap::kRepeat}));
}

/// Makes a scene of a sphere with one material under a light.
ScenePtr make_scene(ProgramId program, const Look& look) {
  SceneBuilder b;
  Material material = make_material(program, {0.6f, 0.5f, 0.4f}, 0.4f);
  const auto at = [&](Input input) -> TextureUse& {
    return material.textures[static_cast<size_t>(input)];
  };
  if (program == ProgramId::kEmissive) material.emission = {1, 1, 1};
  if (look.textures == 1)
    at(Input::kBaseColor) =
        use(add_texture(b, kEdge, kEdge, 3, random_texels(kEdge * kEdge * 3, 0.2f, 0.8f, 1)));
  if (look.textures >= 4) {
    at(Input::kBaseColor) = image(b, 3, true, 0.2f, 0.8f);
    at(Input::kRoughness) = image(b, 1, false, 0.2f, 0.8f);
  }
  if (look.textures == 4) {
    at(Input::kMetallic) = silent(b, 0, look.odd);
    at(Input::kOpacity) = silent(b, 255, look.odd);
  }
  if (look.textures == 5) {
    at(Input::kMetallic) = image(b, 1, false, 0.f, 1.f);
    at(Input::kSpecularColor) = image(b, 3, true, 0.5f, 1.f);
    TextureUse& normal = at(Input::kNormal) = image(b, 3, false, 0.4f, 0.6f);
    normal.scale = {2, 2, 2, 1};
    normal.bias = {-1, -1, -0.1f, 0};
  }
  if (look.edit) look.edit(material);
  const uint32_t id = b.add_material(material);
  b.add_to_group(0, b.add_mesh(make_mesh(sphere(32, true), id)));
  Light light = make_light(LightKind::kRect, {12, 11, 9}, translate(0, 3, 0) * rotate(0, -90));
  b.add_light(light);
  b.set_camera(make_camera({0, 0, 4}, {0, 0, 0}));
  return b.build();
}

template <size_t W>
void shade(benchmark::State& state, ProgramId program, const Look& look, float fill) {
  const ScenePtr scene = make_scene(program, look);
  CalibrationHits hits = find_calibration_hits(*scene).front();
  hits.count = kRecords;
  hits.fill = fill;
  Settings settings;
  settings.policy = "none";
  wave_testing::WaveRun run(scene, {settings, W, 1});
  for (auto _ : state) state.SetIterationTime(1e-9 * run.time_material<W>(hits));
  count_items(state, "record", kRecords);
}

/// Returns whether a shading program supports a material's textures and layers.
bool has(ProgramId program, const Look& look) {
  const bool layered = program == ProgramId::kPrincipled || program == ProgramId::kOpenPbr;
  // Program "emissive" has no base colour.
  if (program == ProgramId::kEmissive) return look.textures == 0 && !look.edit;
  return layered || (look.textures <= 1 && !look.edit);
}

const bool registered = [] {
  for (uint32_t p = 0; p < kProgramCount; ++p)
    for (const Look& look : kLooks)
      for (const float fill : {1.f, 0.35f})
        for_each_width([&]<size_t W>() {
          const auto program = static_cast<ProgramId>(p);
          // A packet of one lane is always full.
          if (!has(program, look) || (fill < 1 && W == 1)) return;
          const std::string name = "shade/" + std::string(kProgramNames[p]) + look.name +
                                   (fill < 1 ? "/full:35%" : "/full:100%") + lanes_label(W);
          benchmark::RegisterBenchmark(name.c_str(), shade<W>, program, look, fill)
              ->UseManualTime()
              ->Unit(benchmark::kMicrosecond);
        });
  return true;
}();

}  // namespace
}  // namespace wavecomb::micro
