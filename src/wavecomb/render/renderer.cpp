// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/render/renderer.h"

#include <tbb/global_control.h>
#include <tbb/info.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <chrono>
#include <limits>
#include <mutex>
#include <utility>

#include "wavecomb/core/clock.h"
#include "wavecomb/core/error.h"
#include "wavecomb/core/task_order.h"
#include "wavecomb/film/error_map.h"
#include "wavecomb/film/film.h"
#include "wavecomb/integrate/ray_recorder.h"
#include "wavecomb/integrate/wave.h"
#include "wavecomb/material/energy_tables.h"
#include "wavecomb/render/cost_profile.h"
#include "wavecomb/render/guide_training.h"
#include "wavecomb/render/kept_training.h"
#include "wavecomb/render/learned.h"
#include "wavecomb/render/light_aiming.h"
#include "wavecomb/render/light_calibration.h"
#include "wavecomb/render/light_paths.h"
#include "wavecomb/render/pass_loop.h"
#include "wavecomb/render/pass_plan.h"
#include "wavecomb/render/pass_runner.h"
#include "wavecomb/render/pick.h"
#include "wavecomb/render/process_memory.h"
#include "wavecomb/render/render_costs.h"
#include "wavecomb/render/render_setup.h"
#include "wavecomb/render/render_statistics.h"
#include "wavecomb/render/snapshot.h"
#include "wavecomb/render/transport_choice.h"
#include "wavecomb/scene/light_tree.h"
#include "wavecomb/scene/scene.h"
#include "wavecomb/schedule/policy.h"

namespace wavecomb {
namespace {

/// The darkest layer of cascades (film/cascades.h), over the brightness of the scene.
constexpr float kDarkestShare = 0x1p-12f;

}  // namespace

struct WavefrontRenderer::Impl {
  // Replaced by edits and renders, under the mutex.
  std::shared_ptr<const Scene> scene;
  std::shared_ptr<const EmbreeAccelerator> accel;
  uint64_t version = 0;
  std::shared_ptr<const Learned> learned;  ///< of the last render that was not stopped before
  Watch* watch = nullptr;                  ///< of the render that goes on
  RenderStatistics statistics;             ///< of the last render
  CostProfile profile;                     ///< after the last render
  mutable std::mutex mutex;

  uint32_t threads = 0;
  double build_s = 0;
  LightCalibrationCache light_calibrations;
  GuideTrainingCache trainings;

  /// What trials before a picture share.
  struct TrialMeans {
    const Settings& picture;            ///< for which lights are weighed
    std::optional<LightAiming> aiming;  ///< of the first with light paths
  };
  /// Renders with settings whose transport is chosen; a trial with its means.
  Picture render(const Settings& settings, LightPathShare light_share, const RenderOptions& options,
                 Watch& watch, TrialMeans* trial = nullptr);
  /// A small picture, for choose_transport; ends where `outer` is stopped.
  TransportTrial try_out(const Settings& settings, LightPathShare share, bool wants_squares,
                         TrialMeans& means, const Watch& outer);
};

namespace {

/// Says that a render goes on, for as long as it lives.
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

std::unique_ptr<WavefrontRenderer> WavefrontRenderer::twin() const {
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
  return impl_->learned ? packed_training(*impl_->learned->training) : std::vector<std::byte>();
}

std::optional<LearnedPlace> WavefrontRenderer::learned(float x, float y, uint32_t width,
                                                       uint32_t height) const {
  const std::optional<Pick> seen = pick(x, y, width, height);
  std::unique_lock lock(impl_->mutex);
  const auto learned = impl_->learned;
  lock.unlock();
  if (!seen || seen->light != kNoLight || !learned) return std::nullopt;
  const Vec3<float> n = dot(seen->normal, seen->dir) > 0 ? -seen->normal : seen->normal;
  return look_up(*learned, {seen->position, n, seen->material});
}

RenderStatistics WavefrontRenderer::statistics() const {
  const std::lock_guard lock(impl_->mutex);
  return impl_->statistics;
}

CostProfile WavefrontRenderer::cost_profile() const {
  const std::lock_guard lock(impl_->mutex);
  return impl_->profile;
}

TransportTrial WavefrontRenderer::Impl::try_out(const Settings& settings, LightPathShare share,
                                                bool wants_squares, TrialMeans& means,
                                                const Watch& outer) {
  RenderOptions options;
  options.wants_camera_squares = wants_squares;
  options.progress = [&](const RenderStatus&) {
    return outer.stopped() ? Request::kStop : Request::kGoOn;
  };
  Watch watch(options.interval_s);
  TransportTrial trial;
  Picture picture = render(settings, share, options, watch, &means);
  trial.beauty = std::move(picture.beauty);
  for (AovLayer& layer : picture.aovs)
    if (layer.name == aov_name(Aov::kByLightPaths)) trial.by_light_paths = std::move(layer.values);
  trial.rays = statistics.rays + statistics.shadow_rays;
  trial.records = statistics.records;
  return trial;
}

Picture WavefrontRenderer::render(const Settings& settings, const RenderOptions& options) {
  settings.check();
  Watch watch(options.interval_s);
  const Running running(*impl_, watch);
  if (settings.transport != Transport::kAuto) {
    // A light path shows light that is scattered once or more.
    Settings used = settings;
    if (used.max_depth == 0) used.transport = Transport::kPath;
    return impl_->render(used, {}, options, watch);
  }
  Impl::TrialMeans means{settings, {}};
  const TransportChoice choice = choose_transport(
      *impl_->scene, settings,
      [&](const Settings& s, LightPathShare share, bool squares) {
        return impl_->try_out(s, share, squares, means, watch);
      },
      [&] { return watch.stopped(); });
  Settings chosen = settings;
  chosen.transport = choice.transport;
  if (chosen.time_limit > 0)
    chosen.time_limit = std::max(1e-6f, chosen.time_limit - static_cast<float>(choice.seconds));
  Picture picture = impl_->render(chosen, choice.share, options, watch);
  const std::lock_guard lock(impl_->mutex);
  impl_->statistics.transport = choice;
  return picture;
}

Picture WavefrontRenderer::Impl::render(const Settings& settings, LightPathShare light_share,
                                        const RenderOptions& options, Watch& watch,
                                        TrialMeans* trial) {
  const Scene& scene = *this->scene;
  const uint32_t lanes = choose_lanes(settings.lanes);
  const LaneKernels kernels = lane_kernels(lanes);
  const uint32_t threads = thread_count(settings);
  std::vector<std::unique_ptr<SchedulingPolicy>> owned;
  std::vector<const SchedulingPolicy*> policies;
  if (options.policy) {
    policies.push_back(options.policy);
  } else {
    owned = choose_policies(settings.policy);
    for (const auto& policy : owned) policies.push_back(policy.get());
  }
  const bool wants_position = std::any_of(policies.begin(), policies.end(), [](const auto* policy) {
    return (policy->columns() & kPositionColumn) != 0;
  });
  const std::vector<MaterialTraits> traits = material_traits(scene);
  RenderCosts costs(scene, traits, settings);
  const FilterTable filter(settings.filter, settings.used_filter_width());
  const CameraSetup camera(scene.camera(), settings.width, settings.height, filter,
                           settings.overscan);
  const AovTables aovs(scene, settings);
  const Region window = settings.film();
  Film film(window, aovs.layout, settings.keeps_error());
  const SplatFilter splat_filter = splat_filter_of(camera, filter, settings.rendered());
  if (settings.joins_light()) {
    check_light_paths(scene, settings);
    film.keep_splats(splat_unit(scene), size_t{settings.width} * settings.height,
                     double{light_share.paths()});
  }
  if (settings.merges()) film.keep_visible_points();
  if (settings.firefly == Firefly::kReweight)
    film.keep_cascades(scene_brightness(scene) * kDarkestShare);
  PassState pass;
  std::vector<std::byte> learned_before;
  if (options.resume) learned_before = options.resume(film, pass);
  if (learned_before.empty() && is_taught(settings)) learned_before = options.learned;
  const uint64_t pixels = settings.rendered().pixels();
  const uint32_t wave_size = wave_size_for(settings, pixels);
  SceneView scene_view = scene.view();
  scene_view.lights.by_tree = chooses_by_tree(settings.light_selection, scene_view.lights);
  if (scene_view.lights.by_tree) scene_view.lights.tree = scene.light_tree(threads).view();
  scene_view.materials.energy = energy_tables(scene.materials());
  WaveContext context{
      scene_view,
      accel.get(),
      &settings,
      &camera,
      policies,
      traits,
      &costs.order,
      &costs.roulette,
      order_grid(scene.bounds()),
      &film,
      settings.traversal == Traversal::kSingle ? 1u : std::min(lanes, accel->native_width()),
      wants_position,
      costs.measures(),
      options.recorder,
      &aovs};

  if (settings.joins_light()) context.splat_filter = &splat_filter;
  VisibleGrid visible;
  if (settings.merges()) context.visible = &visible;
  context.light_paths = light_share.paths();
  const Clock::time_point start = Clock::now();
  const std::unique_ptr<Integrator> integrator =
      make_integrator(settings.integrator, context, lanes, threads, wave_size);
  PassRunner runner(*integrator, threads, wave_size);
  PassLoop loop(settings, pass_step(settings, pixels, wave_size), std::move(pass), light_share,
                film, runner, costs, watch, [&] {
                  if (settings.merges()) visible.build(film.visible_points());
                });
  const LightCalibration* lights = nullptr;
  std::vector<std::string> without_paths;
  if (settings.joins_light()) without_paths = lights_without_paths(scene);
  auto training = std::make_shared<const GuideTraining>();
  GuideView guide;
  LightAiming aiming;
  const TrainingMeans means{lanes, threads, wave_size};
  const auto work = [&] {
    lights =
        &light_calibrations.get(this->scene, *accel, scene_view, trial ? trial->picture : settings,
                                [&] { return watch.stopped(); });
    lights->weighed.apply(context.scene.lights);
    if (settings.joins_light()) send_paths(scene, context.scene.lights);
    costs.start(context, kernels, options.profile, [&] { return watch.halted(); });
    if (settings.joins_light() && settings.light_aim) {
      aiming = trial && trial->aiming
                   ? *trial->aiming
                   : learn_to_aim(context, scene, means, [&] { return watch.stopped(); });
      if (trial) trial->aiming = aiming;
      if (aiming.aim.count > 0) context.scene.lights.aim = &aiming.aim;
    }
    training = learned_before.empty()
                   ? trainings.get(this->scene, context, means, [&] { return watch.stopped(); })
                   : std::make_shared<const GuideTraining>(
                         unpacked_training(learned_before, scene, settings));
    if (training->field) {
      guide = view_of(*training);
      context.guide = &guide;
    }
    // What is learned is learned of light.
    if (options.wants_camera_squares) context.camera_squares = scene_brightness(scene);
    if (!watch.stopped()) {
      const std::lock_guard lock(mutex);
      learned = std::make_shared<const Learned>(
          Learned{this->scene, scene_view.lights.by_tree, light_calibrations.last(), training});
    }
    loop.run();
  };
  // The workers stand still meanwhile.
  const auto taken = [&] {
    RenderStatistics s;
    s.build_s = build_s;
    s.render_s = seconds_since(start);
    s.first_samples_s = runner.first_samples_s();
    s.threads = threads;
    s.wave_size = wave_size;
    s.cancelled = watch.stopped();
    const RenderStatus status = loop.status();
    s.passes = status.passes;
    s.resumed_samples = status.resumed_samples;
    s.error = status.error;
    s.allotment = loop.allotment();
    s.guiding = training->statistics;
    if (aiming.paths > 0) s.light_aiming = {aiming.aim.count, aiming.paths, aiming.seconds};
    s.lights_without_paths = without_paths;
    add_up(runner, context, scene, costs, s);
    s.scene_bytes = scene.bytes();
    s.accelerator_bytes = accel->bytes();
    s.film_bytes = film.bytes();
    if (lights) s.light_calibration = light_shares(*lights);
    s.peak_rss_bytes = peak_rss_bytes();
    if (const TileStore* store = scene.texture_store()) s.texture_store = store->statistics();
    return s;
  };
  // What is read since a store failed is black: nobody gets to see it.
  const auto check_textures = [&] {
    if (const TileStore* store = scene.texture_store()) store->check();
  };
  const auto snapshot = [&](bool finished) {
    check_textures();
    film.note_light_paths();
    if (options.snapshot)
      options.snapshot(
          {film, loop.pass(), *training, loop.status(), finished, aovs.kept_names, taken});
  };
  const tbb::global_control parallelism(
      tbb::global_control::max_allowed_parallelism,
      std::max<size_t>(threads, static_cast<size_t>(tbb::info::default_concurrency())));
  const auto in_arena = [&] {
    const TaskOrder order;
    tbb::task_arena(static_cast<int>(threads)).execute(order.around(work));
    order.join();
  };
  watch.run(
      in_arena,
      [&] {
        check_textures();
        return options.progress ? options.progress(loop.status()) : Request::kGoOn;
      },
      [&] { snapshot(false); });
  check_textures();
  if (options.progress && !watch.stopped()) options.progress(loop.status());
  snapshot(true);

  RenderStatistics s = taken();
  const auto keep = [&] {
    const std::lock_guard lock(mutex);
    statistics = s;
    profile = costs.profile();
  };
  keep();
  if (!options.wants_picture) return {window.width(), window.height(), {}, {}, {}, {}, {}};
  ErrorMap error;
  error.mean_relative = std::numeric_limits<double>::infinity();
  if (film.has_error()) error = measure_error(film);
  s.error = error.mean_relative;
  Film::Layers layers = std::move(film).finish(aovs.kept_names);
  s.peak_rss_bytes = peak_rss_bytes();
  keep();
  Picture picture{window.width(),
                  window.height(),
                  std::move(layers.beauty),
                  std::move(layers.albedo),
                  std::move(layers.normal),
                  std::move(layers.depth),
                  std::move(layers.samples),
                  std::move(error.error),
                  std::move(layers.variance),
                  std::move(layers.aovs),
                  {}};
  picture.deep = std::move(layers.deep);
  picture.manifests = crypto_manifests(scene, picture.aovs);
  return picture;
}

}  // namespace wavecomb
