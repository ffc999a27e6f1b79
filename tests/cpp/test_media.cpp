// SPDX-License-Identifier: Apache-2.0
// Tests of fog in both integrators: medium events, and shadow rays with coloured transmittance.
#include "media_testing.h"
#include "wave_testing.h"
#include "wavecomb/material/program_table.h"
#include "wavecomb/reference/trace_task.h"
#include "wavecomb/wave/run_wave.h"
#include "wavecomb/wave/stages/shade_batch.h"

namespace wavecomb {
namespace {

using namespace scene_testing;
using namespace wave_testing;
using namespace media_testing;

constexpr uint32_t kWave = 256;

struct FoggyScene {
  ScenePtr scene;
  Fog fog;
};

/// Makes a foggy scene with a floor and a point light and, if `with_lamp`, a sphere light and a
/// dome. `on_floor` aims the camera at the floor.
FoggyScene foggy(const Vec3<float>& extinction, bool with_lamp, bool on_floor, float size) {
  SceneBuilder b;
  const uint32_t grey = b.add_material(make_material(ProgramId::kDiffuse, {0.6f, 0.5f, 0.4f}));
  const uint32_t fog = b.add_material(make_material(ProgramId::kPrincipled, {0.9f, 0.8f, 0.7f}));
  b.add_to_group(0, b.add_mesh(make_mesh(ground(30), grey)));
  Light point = make_light(LightKind::kSphere, {5, 5, 5}, translate(0.6f, 1.6f, 0));
  point.radius = 0;
  b.add_light(point);
  if (with_lamp) {
    point.radius = 0.3f;
    point.to_world = translate(-0.8f, 1.2f, 0);
    b.add_light(point);
    b.add_light(make_light(LightKind::kDome, {0.2f, 0.3f, 0.4f}));
  }
  b.set_camera(on_floor ? make_camera({0, 2, 3}, {0, 0, 0}, size)
                        : make_camera({0, 1, 3}, {0, 1, 0}, size));
  return {b.build(), {extinction, fog}};
}

Settings foggy_settings(uint32_t side, uint32_t spp, uint32_t depth) {
  Settings s;
  s.width = s.height = side;
  s.spp = spp;
  s.max_depth = depth;
  s.filter = FilterKind::kBox;
  s.filter_width = 1;
  s.roulette = RouletteKind::kOff;
  return s;
}

template <typename F>
RenderedImage foggy_waves(const FoggyScene& f, const WaveCase& c, uint32_t wave_size,
                          std::shared_ptr<const EmbreeAccelerator> accel = nullptr) {
  WaveRun run(f.scene, c, std::move(accel));
  Wave& wave = run.reserve(wave_size);
  run.each_task(wave_size, 16, [&](const WaveTask& task) {
    run_wave_through<F>(wave, run.context(), task, f.fog);
  });
  return run.image();
}

RenderedImage foggy_reference(const FoggyScene& f, const Settings& s) {
  WaveRun run(f.scene, {s});
  ReferenceWorker worker(run.context());
  run.each_task(64, 16,
                [&](const WaveTask& task) { trace_task(run.context(), worker, task, f.fog); });
  return run.image();
}

/// Tests scattering events in fog. Their records have no triangle, are sorted together with surface
/// records, and are shaded by a program for volumes. The image must be bitwise equal for all
/// scheduling policies.
TEST(Media, FogIsOnePicture) {
  for (const bool tracks_ratio : {false, true}) {
    FoggyScene f = foggy({0.3f, 0.5f, 0.9f}, true, true, 1.5f);
    f.fog.tracks_ratio = tracks_ratio;
    const auto accel = std::make_shared<const EmbreeAccelerator>(f.scene, 1u);
    Settings s = foggy_settings(13, 5, 5);
    s.roulette = tracks_ratio ? RouletteKind::kCostAware : RouletteKind::kThroughput;
    s.roulette_depth = 1;
    s.aovs.bits |= static_cast<uint32_t>(Aov::kDirect) | static_cast<uint32_t>(Aov::kIndirect);
    const RenderedImage expected = foggy_reference(f, s);
    EXPECT_GT(mean_of(expected).mean, 0.01);
    for (const uint32_t wave_size : {48u, kWave, 4096u})
      for (const std::string& policy : policy_names()) {
        s.policy = policy;
        const std::string what = "waves of " + std::to_string(wave_size) + ", policy " + policy;
        expect_same_image(expected, foggy_waves<float>(f, {s, 1, 1}, wave_size, accel),
                          "1 lane, " + what);
#ifdef WAVECOMB_HAS_LANES_16
        for (const Materialize materialize : {Materialize::kOff, Materialize::kOn}) {
          s.materialize = materialize;
          expect_same_image(
              expected, foggy_waves<Lanes<16>>(f, {s, 16, accel->native_width()}, wave_size, accel),
              "16 lanes, " + what);
        }
#endif
      }
  }
}

/// Light of the point light scattered once along the ray from `o` to `end`, plus the reflection of
/// the floor if the ray ends on it:
///    L = int_0^t sigma a / (4 pi) I / r(x)^2 exp(-sigma (x + r(x))) dx
///        + rho / pi I cos / r(t)^2 exp(-sigma (t + r(t)))
double single_scattering(double sigma, double albedo, double floor_albedo, bool on_floor) {
  const double light[3] = {0.6, 1.6, 0};
  const double o[3] = {0, on_floor ? 2.0 : 1.0, 3}, at[3] = {0, on_floor ? 0.0 : 1.0, 0};
  double d[3], t = 0;
  for (int i = 0; i < 3; ++i) t += (at[i] - o[i]) * (at[i] - o[i]);
  t = std::sqrt(t);
  for (int i = 0; i < 3; ++i) d[i] = (at[i] - o[i]) / t;
  const auto distance = [&](double x) {
    double r2 = 0;
    for (int i = 0; i < 3; ++i) r2 += std::pow(o[i] + x * d[i] - light[i], 2);
    return std::sqrt(r2);
  };
  const double end = on_floor ? t : 60 / sigma;
  constexpr int n = 400000;
  double sum = 0;
  for (int i = 0; i < n; ++i) {
    const double x = (i + 0.5) * end / n, r = distance(x);
    sum += std::exp(-sigma * (x + r)) / (r * r);
  }
  double l = sum * end / n * sigma * albedo / (4 * kPiD) * 5;
  if (on_floor) {
    const double r = distance(t);
    l += floor_albedo / kPiD * 5 * (1.6 / r) / (r * r) * std::exp(-sigma * (t + r));
  }
  return l;
}

/// With about 12 comparisons of 4.2 standard errors each, one run in 3,000 would fail by chance
/// with other seeds (Sidak).
TEST(Media, SingleScatteringIsTheIntegral) {
  const float extinction[3] = {0.3f, 0.5f, 0.9f};
  const double albedo[3] = {0.9, 0.8, 0.7}, floor[3] = {0.6, 0.5, 0.4};
  for (const bool on_floor : {false, true})
    for (const bool tracks_ratio : {false, true}) {
      FoggyScene f = foggy({0.3f, 0.5f, 0.9f}, false, on_floor, 1e-3f);
      f.fog.tracks_ratio = tracks_ratio;
      const Settings s = foggy_settings(size_for_build(32), 512, 1);
#ifdef WAVECOMB_HAS_LANES_16
      const RenderedImage image = foggy_waves<Lanes<16>>(f, {s, 16, 1}, 4096);
#else
      const RenderedImage image = foggy_waves<float>(f, {s, 1, 1}, 4096);
#endif
      for (size_t c = 0; c < 3; ++c) {
        const Mean m = mean_of(image, c);
        const double expected =
            single_scattering(double{extinction[c]}, albedo[c], floor[c], on_floor);
        EXPECT_NEAR(m.mean, expected, 4.2 * m.error + 1e-4 * expected)
            << "channel " << c << (on_floor ? ", floor" : ", air");
        if (!kSanitized) {
          EXPECT_LT(4.2 * m.error, 0.01 * expected) << "too noisy to tell";
        }
      }
    }
}

/// White furnace: walls of radiance 1 around fog without absorption give a radiance of 1
/// everywhere.
TEST(Media, FurnaceOfWhiteFog) {
  SceneBuilder b;
  const uint32_t fog = b.add_material(make_material(ProgramId::kPrincipled, {1, 1, 1}));
  Material wall = make_material(ProgramId::kEmissive);
  wall.emission = {1, 1, 1};
  const uint32_t glow = b.add_material(wall);
  b.add_to_group(0, b.add_mesh(make_mesh(box({-2, -2, -2}, {2, 2, 2}), glow)));
  b.set_camera(make_camera({0, 0, 1}, {0, 0, 0}));
  const FoggyScene f{b.build(), {{0.2f, 0.4f, 0.6f}, fog}};
  const Settings s = foggy_settings(16, size_for_build(256, 16), 200);
  const RenderedImage image = foggy_waves<float>(f, {s, 1, 1}, 4096);
  for (size_t c = 0; c < 3; ++c) {
    const Mean m = mean_of(image, c);
    EXPECT_NEAR(m.mean, 1, 4.2 * m.error + 1e-4);
    EXPECT_LT(4.2 * m.error, kSanitized ? 0.5 : 0.03) << "too noisy to tell";
  }
}

}  // namespace
}  // namespace wavecomb
