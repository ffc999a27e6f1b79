// SPDX-License-Identifier: Apache-2.0
/// Random lights and light selection for tests of the light tree.
#pragma once

#include <cmath>
#include <random>
#include <vector>

#include "light_testing.h"
#include "wavecomb/core/warp.h"
#include "wavecomb/light/sampling/tree_choice.h"

namespace wavecomb::light_testing {

/// Random numbers that are the same on all platforms; the distributions of standard libraries
/// differ.
struct Numbers {
  std::mt19937 rng;
  explicit Numbers(uint32_t seed) : rng(seed) {}
  float operator()() { return static_cast<float>(rng() >> 8) * 0x1p-24f; }
  float between(float lo, float hi) { return lo + (hi - lo) * (*this)(); }
  Vec3<float> point(float half) {
    return {between(-half, half), between(-half, half), between(-half, half)};
  }
  Vec3<float> direction() { return square_to_sphere<float>((*this)(), (*this)()); }
};

/// Makes `n` finite lights of all kinds, including black lights and point lights, and `infinite`
/// infinite lights.
inline Lights random_lights(size_t n, uint32_t seed, size_t infinite = 0) {
  Numbers number(seed);
  std::vector<Light> lights;
  std::vector<EmissiveTriangle> triangles;
  for (size_t i = 0; i < n; ++i) {
    const Vec3<float> at = number.point(10);
    const auto turn =
        rotate(360 * static_cast<double>(number()), 360 * static_cast<double>(number()));
    const float power = number() < 0.1f ? 0.f : std::exp(number.between(-4, 4));
    if (i % 4 == 3) {
      triangles.push_back(make_triangle(at, at + number.point(0.4f), at + number.point(0.4f)));
      for (float& x : triangles.back().radiance) x *= power;
      continue;
    }
    const auto kind = static_cast<LightKind>(i % 4);  // rect, disk, sphere
    Light light = make_light(kind, translate(at.x, at.y, at.z) * turn);
    light.width = number.between(0.05f, 1);
    light.height = number.between(0.05f, 1);
    light.radius = kind == LightKind::kSphere && number() < 0.3f ? 0 : number.between(0.02f, 0.5f);
    light.color = Vec3<float>{1, 1, 1} * power;
    lights.push_back(light);
  }
  for (size_t i = 0; i < infinite; ++i) {
    Light light = make_light(i % 2 ? LightKind::kDistant : LightKind::kDome);
    light.color = Vec3<float>{1e-3f, 1e-3f, 1e-3f} * static_cast<float>(i);
    lights.push_back(light);
  }
  return Lights(lights, triangles);
}

inline LightView by_tree(const Lights& lights) {
  LightView view = lights.view();
  view.by_tree = true;
  return view;
}

inline LightReceiver<float> random_receiver(Numbers& number) {
  const Vec3<float> p = number.point(12);
  const bool any_side = number() < 0.3f;
  return LightReceiver<float>(p, any_side ? 0u : pack_normal<float>(number.direction()));
}

inline float selection_pdf(const LightView& view, uint32_t light, const LightReceiver<float>& to) {
  return light < view.infinite_count ? view.tree.infinite_pdf[light]
                                     : detail::tree_pdf<float>(view, light, to, true);
}

}  // namespace wavecomb::light_testing
