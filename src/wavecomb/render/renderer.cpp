// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/render/renderer.h"

#include <tbb/global_control.h>
#include <tbb/info.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <chrono>
#include <limits>
#include <utility>

#include "wavecomb/film/error_map.h"
#include "wavecomb/integrate/wave.h"

namespace wavecomb {
namespace {

using Clock = std::chrono::steady_clock;

double seconds_since(Clock::time_point start) {
  return std::chrono::duration<double>(Clock::now() - start).count();
}

/// Paths a wave holds unless told otherwise (docs/decisions/wave-size.md), and samples of a pixel
/// that a pass adds.
constexpr uint32_t kDefaultWaveSize = 4096;
constexpr uint32_t kPassSamples = 16;

uint32_t thread_count(const Settings& settings) {
  return settings.threads != 0 ? settings.threads
                               : static_cast<uint32_t>(tbb::info::default_concurrency());
}

/// A wave is no larger than what keeps every worker busy a few times over.
uint32_t wave_size_for(const Settings& settings, uint64_t pixels) {
  const uint64_t total = settings.spp * pixels;
  const uint64_t share = std::max<uint64_t>(64, total / (uint64_t{thread_count(settings)} * 4));
  return static_cast<uint32_t>(
      std::min<uint64_t>(settings.wave_size != 0 ? settings.wave_size : kDefaultWaveSize, share));
}

/// Samples of a pass that is not adaptive: at least enough for a wave to be full when the picture
/// is smaller than a wave.
uint32_t pass_step(const Settings& settings, uint64_t pixels, uint32_t wave_size) {
  const auto fill = static_cast<uint32_t>((wave_size + pixels - 1) / pixels);
  return std::min({settings.spp, wave_size, std::max(kPassSamples, fill)});
}

/// The policies that `name` stands for: one, or those that "adaptive" chooses among, "none" first.
std::vector<std::unique_ptr<SchedulingPolicy>> choose_policies(const std::string& name) {
  std::vector<std::unique_ptr<SchedulingPolicy>> policies;
  if (name == "adaptive")
    for (const char* one : {"none", "program", "material", "texture", "texture-locality"})
      policies.push_back(make_policy(one));
  else
    policies.push_back(make_policy(name));
  return policies;
}

/// The grid over the scene for Morton codes.
OrderGrid order_grid(const Bounds& bounds) {
  OrderGrid grid;
  if (bounds.empty()) return grid;
  const float lo[3] = {bounds.lo.x, bounds.lo.y, bounds.lo.z};
  const float hi[3] = {bounds.hi.x, bounds.hi.y, bounds.hi.z};
  for (int i = 0; i < 3; ++i) {
    grid.lo[i] = lo[i];
    grid.scale[i] = hi[i] > lo[i] ? 1024.f / (hi[i] - lo[i]) : 0.f;
  }
  return grid;
}

/// Names of what the Cryptomatte layers among `layers` hold.
std::vector<CryptoManifest> crypto_manifests(const Scene& scene,
                                             const std::vector<AovLayer>& layers) {
  std::vector<CryptoManifest> manifests;
  for (const AovLayer& layer : layers)
    for (const Aov level : {Aov::kCryptoObject, Aov::kCryptoMaterial, Aov::kCryptoAsset})
      if (layer.name == aov_name(level))
        manifests.push_back({layer.name, crypto_manifest(scene, level, crypto_ids(layer))});
  return manifests;
}

}  // namespace

struct WavefrontRenderer::Impl {
  std::shared_ptr<const Scene> scene;
  std::unique_ptr<EmbreeAccelerator> accel;
  RenderStatistics statistics;
  CostProfile profile;  ///< after the last render
  double build_s = 0;
};

WavefrontRenderer::WavefrontRenderer(std::shared_ptr<const Scene> scene, uint32_t threads)
    : impl_(std::make_unique<Impl>()) {
  const Clock::time_point start = Clock::now();
  impl_->scene = std::move(scene);
  impl_->accel = std::make_unique<EmbreeAccelerator>(impl_->scene, threads);
  impl_->build_s = seconds_since(start);
}

WavefrontRenderer::~WavefrontRenderer() = default;

const RenderStatistics& WavefrontRenderer::statistics() const {
  return impl_->statistics;
}

const CostProfile& WavefrontRenderer::cost_profile() const {
  return impl_->profile;
}

Picture WavefrontRenderer::render(const Settings& settings, const RenderOptions& options) {
  settings.check();
  const Scene& scene = *impl_->scene;
  const uint32_t lanes = choose_lanes(settings.lanes);
  const LaneKernels kernels = lane_kernels(lanes);
  const uint32_t threads = thread_count(settings);
  const bool reference = settings.integrator == IntegratorKind::kReference;
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
  const FilterTable filter(settings.filter, settings.filter_width);
  const CameraSetup camera(scene.camera(), settings.width, settings.height, filter);
  const AovTables aovs(scene, settings);
  Film film(settings.width, settings.height, aovs.layout, settings.keeps_error());
  PassState pass;
  if (options.resume) options.resume(film, pass);
  const uint32_t wave_size = wave_size_for(settings, film.pixel_count());
  const WaveContext context{
      scene.view(),
      impl_->accel.get(),
      &settings,
      &camera,
      policies,
      traits,
      &costs.order,
      &costs.roulette,
      order_grid(scene.bounds()),
      &film,
      settings.traversal == Traversal::kSingle ? 1u : std::min(lanes, impl_->accel->native_width()),
      wants_position,
      costs.measures(),
      options.recorder,
      &aovs};

  const Clock::time_point start = Clock::now();
  Watch watch;
  PassRunner runner(context, kernels, reference, threads, wave_size);
  PassLoop loop(settings, pass_step(settings, film.pixel_count(), wave_size), std::move(pass), film,
                runner, costs, watch);
  const auto work = [&] {
    costs.start(context, kernels, options.profile);
    loop.run();
  };
  const auto snapshot = [&](bool finished) {
    if (options.snapshot) options.snapshot({film, loop.pass(), loop.status(), finished});
  };
  const tbb::global_control parallelism(
      tbb::global_control::max_allowed_parallelism,
      std::max<size_t>(threads, static_cast<size_t>(tbb::info::default_concurrency())));
  watch.run([&] { tbb::task_arena(static_cast<int>(threads)).execute(work); },
            [&] { return options.progress ? options.progress(loop.status()) : Request::kGoOn; },
            [&] { snapshot(false); });
  if (options.progress && !watch.stopped()) options.progress(loop.status());
  snapshot(true);

  RenderStatistics& s = impl_->statistics;
  s = {};
  s.build_s = impl_->build_s;
  s.render_s = seconds_since(start);
  s.first_samples_s = runner.first_samples_s();
  s.threads = threads;
  s.wave_size = wave_size;
  s.lanes = reference ? 1 : lanes;
  s.cancelled = watch.stopped();
  const RenderStatus status = loop.status();
  s.passes = status.passes;
  s.resumed_samples = status.resumed_samples;
  ErrorMap error;
  error.mean_relative = std::numeric_limits<double>::infinity();
  if (film.has_error()) error = measure_error(film);
  s.error = error.mean_relative;
  add_up(runner.workers(), context, scene, costs, s);
  s.scene_bytes = scene.bytes();
  s.accelerator_bytes = impl_->accel->bytes();
  s.film_bytes = film.bytes();
  impl_->profile = costs.profile();
  Film::Layers layers = std::move(film).finish(aovs.kept_names);
  s.peak_rss_bytes = peak_rss_bytes();
  Picture picture{settings.width,
                  settings.height,
                  std::move(layers.beauty),
                  std::move(layers.albedo),
                  std::move(layers.normal),
                  std::move(layers.depth),
                  std::move(layers.samples),
                  std::move(error.error),
                  std::move(layers.variance),
                  std::move(layers.aovs),
                  {}};
  picture.manifests = crypto_manifests(scene, picture.aovs);
  return picture;
}

}  // namespace wavecomb
