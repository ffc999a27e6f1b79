// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/light_paths/render/light_aiming.h"

#include <algorithm>
#include <memory>

#include "wavecomb/core/clock.h"
#include "wavecomb/film/filter.h"
#include "wavecomb/light_paths/aiming/aim_samples.h"
#include "wavecomb/light_paths/setup.h"
#include "wavecomb/render/inspection/picking.h"
#include "wavecomb/render/lane_kernels.h"
#include "wavecomb/render/passes/pass_runner.h"

namespace wavecomb {
namespace {

constexpr uint32_t kAimRounds = 4, kAimSeed = 0x9e3779b9u;
/// Number of grid cells along each side of the image; a camera ray through each cell finds a
/// visible surface point.
constexpr uint32_t kVisibleCells = 48;
/// A training round traces one light path for every `kAimShare` pixels of the image, but at least
/// `kMinAimPaths` and at most `kMaxAimPaths` light paths.
constexpr uint64_t kAimShare = 4, kMinAimPaths = 8192, kMaxAimPaths = 131'072;

/// Returns spheres around the points that the camera sees. The radii are doubled, to include
/// objects that reflect or focus light onto these points.
LightAim aim_at_visible(const Scene& scene, const EmbreeAccelerator& accel,
                        const Settings& settings, float scene_radius) {
  std::vector<AimSample> hits;
  for (const Vec3<float>& p :
       visible_surface_points(scene, accel, settings.width, settings.height, kVisibleCells))
    hits.push_back({p.x, p.y, p.z, 1.f});
  LightAim aim = aim_targets(hits, scene_radius);
  for (uint32_t k = 0; k < aim.count; ++k)
    aim.radius[k] = std::min(2 * aim.radius[k], scene_radius);
  return aim;
}

/// Returns a plan with one sample of each of the first `count` light paths. The plan stores the
/// number of a light path as pixel coordinates. In a small image, these coordinates may lie below
/// the last row.
PassPlan first_paths(const Settings& settings, uint64_t count, uint32_t sample) {
  PassPlan plan;
  plan.pixels.reserve(count);
  for (uint64_t i = 0; i < count; ++i)
    plan.pixels.push_back(static_cast<uint32_t>(i % settings.width | (i / settings.width) << 16));
  plan.batches.push_back({0, plan.pixels.size(), sample, 1});
  return plan;
}

}  // namespace

LightAiming learn_to_aim(const WaveContext& render, const Scene& scene, const WaveSetup& waves,
                         const std::function<bool()>& stopped) {
  const Clock::time_point start = Clock::now();
  LightAiming out;
  if (!render.scene.lights.emits_paths()) return out;
  Settings settings = *render.settings;
  settings.region.reset();
  settings.crop = false;
  settings.aovs = {};
  settings.seed = kAimSeed;
  // Disable roulette, which would add noise by increasing the contribution of surviving paths.
  settings.roulette = RouletteKind::kOff;
  const FilterTable filter(settings.filter, settings.used_filter_width());
  const LightSplatFilter light_splat_filter =
      make_light_splat_filter(*render.camera, filter, settings.rendered());
  WaveContext context = render;
  context.settings = &settings;
  context.joint.filter = &light_splat_filter;
  context.recorder = nullptr;
  const uint64_t numbers = uint64_t{settings.width} * settings.height;
  const uint64_t count = std::clamp(numbers / kAimShare, kMinAimPaths, kMaxAimPaths);
  const std::unique_ptr<Integrator> integrator =
      make_integrator(settings.integrator, context, waves.lanes, waves.threads, waves.wave_size);
  PassRunner runner(*integrator, waves.threads, waves.wave_size);
  out.aim = aim_at_visible(scene, *context.accel, settings, context.scene.lights.radius);
  for (uint32_t round = 0; round < kAimRounds; ++round) {
    AimSamples aim_samples(count);
    context.joint.aim_samples = &aim_samples;
    context.scene.lights.aim = out.aim.count > 0 ? &out.aim : nullptr;
    runner.run(first_paths(settings, count, round), stopped, true);
    if (stopped()) return {};
    out.aim = aim_targets(aim_samples.rows(), context.scene.lights.radius);
    out.paths += count;
  }
  out.seconds = seconds_since(start);
  return out;
}

void LightPathPilot::prepare(const Scene& scene, WaveContext& context) {
  if (context.joint.is_active()) send_paths(scene, context.scene.lights);
}

std::shared_ptr<const LightAiming> LightPathPilot::run(
    const Scene& scene, const WaveSetup& waves, const std::shared_ptr<const LightAiming>& earlier,
    const std::function<bool()>& stopped, WaveContext& context) {
  if (!context.joint.is_active() || !context.settings->light_aim) return nullptr;
  auto aiming =
      earlier ? earlier
              : std::make_shared<const LightAiming>(learn_to_aim(context, scene, waves, stopped));
  if (aiming->aim.count > 0) context.scene.lights.aim = &aiming->aim;
  return aiming;
}

}  // namespace wavecomb
