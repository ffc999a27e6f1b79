// SPDX-License-Identifier: Apache-2.0
// Cost of selecting a light and sampling a point on it, by kind of light.
#include <random>
#include <vector>

#include "light_testing.h"
#include "wavecomb/light/description/light_table.h"
#include "widths.h"

namespace wavecomb::micro {
namespace {

using namespace light_testing;

constexpr size_t kSamples = 4096;

/// Makes four lights of the kind `kind`, or two lights of every kind if `kind` is
/// `kLightKindCount`.
Lights make_lights(uint32_t kind) {
  std::vector<Light> lights;
  std::vector<EmissiveTriangle> triangles;
  Lights made;
  const uint32_t sky = made.add_texture(256, 128, std::vector<float>(256 * 128 * 3, 0.7f));
  const auto add = [&](LightKind k, int n) {
    for (int i = 0; i < n; ++i) {
      const auto x = static_cast<float>(i);
      if (k == LightKind::kTriangle) {
        triangles.push_back(make_triangle({x, 3, 0}, {x + 1, 3, 0}, {x, 3, 1}));
        continue;
      }
      Light light = make_light(k, translate(2 * x - 3, 3, 0) * rotate(-90, 10 * i));
      if (k == LightKind::kDome) light.texture = sky;
      lights.push_back(light);
      if (k == LightKind::kDome) break;
    }
  };
  if (kind < kLightKindCount)
    add(static_cast<LightKind>(kind), 4);
  else
    for (uint32_t k = 0; k < kLightKindCount; ++k) add(static_cast<LightKind>(k), 2);
  made.build(lights, triangles);
  return made;
}

template <size_t W>
void light(benchmark::State& state, uint32_t kind) {
  using F = Lanes<W>;
  const Lights lights = make_lights(kind);
  const LightView view = lights.view();
  std::mt19937 random(3);
  std::uniform_real_distribution<float> uniform(0, 1);
  std::vector<float> columns[6];
  for (auto& column : columns)
    for (size_t i = 0; i < kSamples; ++i) column.push_back(std::min(uniform(random), 0.9999f));
  // Round the random numbers to multiples of 2^-24, since samplers return such numbers.
  for (float& pick : columns[3]) pick = std::floor(pick * 0x1p24f) * 0x1p-24f;
  for (auto _ : state) {
    F sum(0.f);
    for (size_t i = 0; i < kSamples; i += W) {
      const auto at = [&](int c) { return load<F>(columns[c].data() + i); };
      const LightSample<F> s =
          sample_light<F>(view, Vec3<F>{at(0), at(1), at(2)}, at(3), at(4), at(5), Mask<F>(true));
      sum = sum + (s.weight.x + s.weight.y + s.weight.z + s.wi.x + s.pdf);
    }
    keep<F>(sum);
  }
  count_items(state, "light_sample", kSamples);
}

const bool registered = [] {
  for (uint32_t kind = 0; kind <= kLightKindCount; ++kind) {
    const std::string name =
        kind < kLightKindCount ? light_kind_name(static_cast<LightKind>(kind)) : "all";
    for_each_width([&]<size_t W>() {
      benchmark::RegisterBenchmark(("light/" + name + lanes_label(W)).c_str(), light<W>, kind);
    });
  }
  return true;
}();

}  // namespace
}  // namespace wavecomb::micro
