// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/render/pilots/planner.h"

#include <algorithm>
#include <utility>

#include "wavecomb/core/clock.h"
#include "wavecomb/render/joint_transport.h"
#include "wavecomb/render/render_plan.h"
#include "wavecomb/render/watch.h"
#include "wavecomb/scene/scene.h"

namespace wavecomb {
namespace {

/// Largest fraction of a time limit that pilot renders for the transport may take.
constexpr double kPilotShare = 0.05;

/// Decides the settings that need no pilot render.
Settings without_open_choices(Settings used) {
  if (used.quality == Quality::kPlain) {
    if (used.guiding == Guiding::kAuto) used.guiding = Guiding::kOff;
    if (used.transport == Transport::kAuto) used.transport = Transport::kPath;
  }
  // Roulette by efficiency needs training, even if guiding does not help.
  if (used.roulette == RouletteKind::kEfficient && used.guiding == Guiding::kAuto)
    used.guiding = Guiding::kOff;
  if (used.transport == Transport::kAuto) return used;
  // Light paths contribute only light that is scattered at least once.
  if (used.max_depth == 0) used.transport = Transport::kPath;
  // The pilot renders of guiding do not connect camera paths to light paths.
  if (used.connects() && used.guiding == Guiding::kAuto) used.guiding = Guiding::kOff;
  return used;
}

/// Options of a pilot render, which gives up if `stopped` returns true.
RenderOptions pilot_options(const std::function<bool()>& stopped) {
  RenderOptions options;
  options.progress = [&stopped](const RenderStatus&) {
    return stopped() ? Request::kStop : Request::kContinue;
  };
  return options;
}

}  // namespace

Planner::Planner(std::shared_ptr<const Scene> scene, std::shared_ptr<const EmbreeAccelerator> accel,
                 double build_s, PilotCache& cache)
    : scene_(std::move(scene)), accel_(std::move(accel)), build_s_(build_s), cache_(cache) {}

PlannedSettings Planner::plan(const Settings& settings, const RenderOptions& options,
                              const Stopped& stopped) {
  PlannedSettings planned;
  Settings& used = planned.settings;
  used = without_open_choices(settings);
  if (used.transport != Transport::kAuto) return planned;
  const TransportChoice choice = choose(used, options, stopped);
  used.transport = choice.transport;
  if (choice.merges && used.merge_radius == 0) used.merge_radius = 1.f;
  if (used.time_limit > 0)
    used.time_limit = std::max(1e-6f, used.time_limit - static_cast<float>(choice.seconds));
  used = without_open_choices(used);
  planned.share = choice.share;
  planned.choice = choice;
  return planned;
}

TransportPilot Planner::render_pilot(const Settings& settings, LightPathShare share,
                                     bool wants_squares, const PilotShared& shared,
                                     const Stopped& stopped) {
  RenderOptions options = pilot_options(stopped);
  options.wants_camera_squares = wants_squares;
  Watch watch(options.interval_s);
  const RenderPlan plan(*scene_, *accel_, settings, share, options.policy);
  RenderRun run(scene_, plan, options, watch, build_s_, {});
  run.run(cache_, shared, [](const PilotResults&) {});
  RenderStatistics counted = run.statistics();
  RenderedImage image = run.finish(counted);
  TransportPilot pilot;
  pilot.beauty = std::move(image.beauty);
  for (AovLayer& layer : image.aovs)
    if (layer.name == aov_name(Aov::kByLightPaths)) pilot.by_light_paths = std::move(layer.values);
  pilot.work = {static_cast<double>(counted.rays + counted.shadow_rays),
                static_cast<double>(counted.records)};
  return pilot;
}

TransportChoice Planner::choose(const Settings& settings, const RenderOptions& options,
                                const Stopped& abandoned) {
  if (!options.learned.empty()) {
    TransportChoice earlier = unpacked_transport(options.learned);
    // The scene or the settings may have changed since the earlier render.
    Settings used = settings;
    if (earlier.merges && used.merge_radius == 0) used.merge_radius = 1.f;
    const bool may_merge = !earlier.merges || settings.auto_merge || settings.merge_radius > 0;
    if (earlier.transport == Transport::kPath ||
        (may_merge && light_path_conflict(used).what.empty() &&
         light_path_conflict(*scene_).what.empty()))
      return earlier;
  }
  if (options.resume) {  // The checkpoint is from a version that stored no choice of transport and
                         // did not use light paths by default.
    TransportChoice kept;
    kept.why = "as in the render that is resumed";
    return kept;
  }
  if (const auto kept = cache_.transports.find(scene_, settings)) return *kept;
  std::shared_ptr<const LightAiming> aiming;
  const PilotShared shared{&settings, &aiming};
  const Clock::time_point start = Clock::now();
  const auto stopped = [&] {
    const bool is_late =
        settings.time_limit > 0 && seconds_since(start) > kPilotShare * settings.time_limit;
    return is_late || abandoned();
  };
  const TransportChoice choice = choose_transport(
      *scene_, settings, expected_samples(settings, thread_count(settings)),
      [&](const Settings& s, LightPathShare share, bool squares) {
        return render_pilot(s, share, squares, shared, stopped);
      },
      stopped);
  if (!abandoned()) cache_.transports.keep(scene_, settings, choice);
  return choice;
}

}  // namespace wavecomb
