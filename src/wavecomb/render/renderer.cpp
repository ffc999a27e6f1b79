// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/render/renderer.h"

#include <algorithm>
#include <functional>
#include <mutex>
#include <utility>

#include "wavecomb/core/clock.h"
#include "wavecomb/core/error.h"
#include "wavecomb/render/inspection/learned_lookup.h"
#include "wavecomb/render/inspection/picking.h"
#include "wavecomb/render/joint_transport.h"
#include "wavecomb/render/pilots/training_cache.h"
#include "wavecomb/render/render_plan.h"
#include "wavecomb/render/render_run.h"
#include "wavecomb/render/snapshot.h"
#include "wavecomb/render/statistics/cost_profile.h"
#include "wavecomb/render/statistics/render_statistics.h"
#include "wavecomb/scene/scene.h"

namespace wavecomb {
struct WavefrontRenderer::Impl {
  // The mutex guards these members, which edits and renders replace.
  std::shared_ptr<const Scene> scene;
  std::shared_ptr<const EmbreeAccelerator> accel;
  uint64_t version = 0;
  std::shared_ptr<const Learned>
      learned;  ///< learned data of the last render that was not stopped during its pilots
  Watch* watch = nullptr;       ///< watch of the running render
  RenderStatistics statistics;  ///< statistics of the last render
  CostProfile profile;          ///< costs after the last render
  mutable std::mutex mutex;

  uint32_t threads = 0;
  double build_s = 0;
  PilotCache pilot_cache;

  /// Renders with settings whose transport is decided, and keeps the statistics.
  RenderedImage render(const Settings& settings, LightPathShare light_share,
                       const RenderOptions& options, Watch& watch,
                       const std::optional<TransportChoice>& choice = {});
  /// Chooses the transport for `settings` with Transport::kAuto.
  TransportChoice choose(const Settings& settings, const RenderOptions& options, Watch& watch);
  /// Renders a small image for choose_transport(). Gives up if `stopped` returns true.
  TransportPilot render_pilot(const Settings& settings, LightPathShare share, bool wants_squares,
                              const PilotShared& shared, const std::function<bool()>& stopped);
  /// Returns the predicted gain of path guiding for `settings` without light paths, or 0 if guiding
  /// would not be used. Gives up if `stopped` returns true.
  double guiding_gain(Settings settings, const std::function<bool()>& stopped);
};

namespace {

/// Largest fraction of a time limit that pilot renders for the transport may take.
constexpr double kPilotShare = 0.05;

/// Predicted gain of light paths from which guiding is not considered. Smaller gains are compared,
/// because guiding and light paths exclude each other.
constexpr double kSureGain = 4;

/// Decides those settings that need no pilot render.
Settings without_open_choices(Settings used) {
  if (used.quality == Quality::kPlain) {
    if (used.guiding == Guiding::kAuto) used.guiding = Guiding::kOff;
    if (used.transport == Transport::kAuto) used.transport = Transport::kPath;
  }
  // Roulette by efficiency needs training whether or not guiding helps.
  if (used.roulette == RouletteKind::kEfficient && used.guiding == Guiding::kAuto)
    used.guiding = Guiding::kOff;
  if (used.transport == Transport::kAuto) return used;
  // Light paths contribute only light that is scattered at least once.
  if (used.max_depth == 0) used.transport = Transport::kPath;
  if (used.joins_light() && used.guiding == Guiding::kAuto) used.guiding = Guiding::kOff;
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

/// Marks the renderer as rendering during its lifetime.
template <typename Impl>
class Running {
 public:
  Running(Impl& impl, Watch& watch) : impl_(impl) {
    const std::lock_guard lock(impl_.mutex);
    if (impl_.watch) throw Error("a render goes on; stop it first, or use a twin");
    impl_.watch = &watch;
  }
  ~Running() {
    const std::lock_guard lock(impl_.mutex);
    impl_.watch = nullptr;
  }
  Running(const Running&) = delete;
  Running& operator=(const Running&) = delete;

 private:
  Impl& impl_;
};

}  // namespace

WavefrontRenderer::WavefrontRenderer(std::shared_ptr<const Scene> scene, uint32_t threads)
    : impl_(std::make_unique<Impl>()) {
  const Clock::time_point start = Clock::now();
  impl_->scene = std::move(scene);
  impl_->threads = threads;
  impl_->accel = std::make_shared<const EmbreeAccelerator>(impl_->scene, threads);
  impl_->build_s = seconds_since(start);
}

WavefrontRenderer::WavefrontRenderer(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}

WavefrontRenderer::~WavefrontRenderer() = default;

std::unique_ptr<WavefrontRenderer> WavefrontRenderer::clone() const {
  auto impl = std::make_unique<Impl>();
  const std::lock_guard lock(impl_->mutex);
  impl->scene = impl_->scene;
  impl->accel = impl_->accel;
  impl->threads = impl_->threads;
  impl->build_s = impl_->build_s;
  return std::unique_ptr<WavefrontRenderer>(new WavefrontRenderer(std::move(impl)));
}

void WavefrontRenderer::edit(const SceneEdit& change) {
  const auto check_idle = [&] {
    if (impl_->watch) throw Error("a render goes on; stop it before the scene is edited");
  };
  {
    const std::lock_guard lock(impl_->mutex);
    check_idle();
  }
  std::shared_ptr<const Scene> scene = impl_->scene->edited(change, impl_->threads);
  auto accel = std::make_shared<const EmbreeAccelerator>(scene, *impl_->accel, impl_->threads);
  const std::lock_guard lock(impl_->mutex);
  check_idle();
  impl_->scene = std::move(scene);
  impl_->accel = std::move(accel);
  ++impl_->version;
}

void WavefrontRenderer::stop() {
  const std::lock_guard lock(impl_->mutex);
  if (impl_->watch) impl_->watch->stop();
}

std::shared_ptr<const Scene> WavefrontRenderer::scene() const {
  const std::lock_guard lock(impl_->mutex);
  return impl_->scene;
}

uint64_t WavefrontRenderer::version() const {
  const std::lock_guard lock(impl_->mutex);
  return impl_->version;
}

std::optional<Pick> WavefrontRenderer::pick(float x, float y, uint32_t width,
                                            uint32_t height) const {
  std::unique_lock lock(impl_->mutex);
  const auto scene = impl_->scene;
  const auto accel = impl_->accel;
  lock.unlock();
  return wavecomb::pick(*scene, *accel, x, y, width, height);
}

std::vector<std::byte> WavefrontRenderer::packed_learned() const {
  const std::lock_guard lock(impl_->mutex);
  if (!impl_->learned) return {};
  return packed_training(*impl_->learned->training, impl_->learned->transport);
}

std::optional<LearnedData> WavefrontRenderer::learned(float x, float y, uint32_t width,
                                                      uint32_t height) const {
  const std::optional<Pick> picked = pick(x, y, width, height);
  std::unique_lock lock(impl_->mutex);
  const auto learned = impl_->learned;
  lock.unlock();
  if (!picked || picked->light != kNoLight || !learned) return std::nullopt;
  const Vec3<float> n = dot(picked->normal, picked->dir) > 0 ? -picked->normal : picked->normal;
  return look_up(*learned, {picked->position, n, picked->material});
}

RenderStatistics WavefrontRenderer::statistics() const {
  const std::lock_guard lock(impl_->mutex);
  return impl_->statistics;
}

CostProfile WavefrontRenderer::cost_profile() const {
  const std::lock_guard lock(impl_->mutex);
  return impl_->profile;
}

TransportPilot WavefrontRenderer::Impl::render_pilot(const Settings& settings, LightPathShare share,
                                                     bool wants_squares, const PilotShared& shared,
                                                     const std::function<bool()>& stopped) {
  RenderOptions options = pilot_options(stopped);
  options.wants_camera_squares = wants_squares;
  Watch watch(options.interval_s);
  const RenderPlan plan(*scene, *accel, settings, share, options.policy);
  RenderRun run(scene, plan, options, watch, build_s, {});
  run.run(pilot_cache, shared, [](const PilotResults&) {});
  RenderStatistics counted = run.statistics();
  RenderedImage image = run.finish(counted);
  TransportPilot pilot;
  pilot.beauty = std::move(image.beauty);
  for (AovLayer& layer : image.aovs)
    if (layer.name == aov_name(Aov::kByLightPaths)) pilot.by_light_paths = std::move(layer.values);
  pilot.rays = counted.rays + counted.shadow_rays;
  pilot.records = counted.records;
  return pilot;
}

double WavefrontRenderer::Impl::guiding_gain(Settings settings,
                                             const std::function<bool()>& stopped) {
  // Training depends on the whole image only, so rendering one pixel is sufficient.
  settings.transport = Transport::kPath;
  settings.region = Region{0, 0, 1, 1};
  settings.crop = true;
  settings.aovs = {};
  settings.light_groups.clear();
  settings.expressions.clear();
  const RenderOptions options = pilot_options(stopped);
  Watch watch(options.interval_s);
  const RenderPlan plan(*scene, *accel, settings, {}, options.policy);
  RenderRun run(scene, plan, options, watch, build_s, {});
  run.run(pilot_cache, {}, [](const PilotResults&) {});
  const GuidingStatistics guiding = run.statistics().guiding;
  return guiding.used ? guiding.gain : 0;
}

RenderedImage WavefrontRenderer::render(const Settings& settings, const RenderOptions& options) {
  settings.check();
  Watch watch(options.interval_s);
  const Running running(*impl_, watch);
  Settings used = without_open_choices(settings);
  if (used.transport != Transport::kAuto) return impl_->render(used, {}, options, watch);
  const TransportChoice choice = impl_->choose(used, options, watch);
  used.transport = choice.transport;
  if (used.time_limit > 0)
    used.time_limit = std::max(1e-6f, used.time_limit - static_cast<float>(choice.seconds));
  used = without_open_choices(used);
  return impl_->render(used, choice.share, options, watch, choice);
}

TransportChoice WavefrontRenderer::Impl::choose(const Settings& settings,
                                                const RenderOptions& options, Watch& watch) {
  if (!options.learned.empty()) {
    TransportChoice earlier = unpacked_transport(options.learned);
    // The scene or the settings may have changed since the earlier render.
    if (earlier.transport == Transport::kPath ||
        (light_path_conflict(settings).what.empty() && light_path_conflict(*scene).what.empty()))
      return earlier;
  }
  if (options.resume) {  // The checkpoint is from a version that stored no choice of transport and
                         // did not use light paths by default.
    TransportChoice kept;
    kept.why = "as in the render that is resumed";
    return kept;
  }
  if (const auto kept = pilot_cache.transports.find(scene, settings)) return *kept;
  std::shared_ptr<const LightAiming> aiming;
  const PilotShared shared{&settings, &aiming};
  const Clock::time_point start = Clock::now();
  const auto stopped = [&] {
    const bool is_late =
        settings.time_limit > 0 && seconds_since(start) > kPilotShare * settings.time_limit;
    return is_late || watch.stopped();
  };
  TransportChoice choice = choose_transport(
      *scene, settings, expected_samples(settings, thread_count(settings)),
      [&](const Settings& s, LightPathShare share, bool squares) {
        return render_pilot(s, share, squares, shared, stopped);
      },
      stopped);
  const bool may_guide = settings.guiding == Guiding::kAuto && choice.gain < kSureGain;
  if (choice.transport == Transport::kLight && may_guide) {
    const double gain = guiding_gain(settings, stopped);
    if (gain >= choice.gain) {
      choice.transport = Transport::kPath;
      choice.why += ", since guiding is expected to gain more";
    }
    choice.seconds = seconds_since(start);
  }
  if (!watch.stopped()) pilot_cache.transports.keep(scene, settings, choice);
  return choice;
}

RenderedImage WavefrontRenderer::Impl::render(const Settings& settings, LightPathShare light_share,
                                              const RenderOptions& options, Watch& watch,
                                              const std::optional<TransportChoice>& choice) {
  const RenderPlan plan(*scene, *accel, settings, light_share, options.policy);
  RenderRun run(scene, plan, options, watch, build_s, choice);
  run.run(pilot_cache, {}, [&](const PilotResults& found) {
    const std::lock_guard lock(mutex);
    learned = std::make_shared<const Learned>(
        Learned{scene, plan.view.lights.by_tree, found.lights, found.training, choice});
  });
  RenderStatistics s = run.statistics();
  const auto keep = [&] {
    const std::lock_guard lock(mutex);
    statistics = s;
    profile = run.cost_profile();
  };
  keep();
  RenderedImage image = run.finish(s);
  keep();
  return image;
}

}  // namespace wavecomb
