// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/render/render_run.h"

#include <tbb/global_control.h>
#include <tbb/info.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <limits>
#include <utility>

#include "wavecomb/core/task_order.h"
#include "wavecomb/film/error/error_map.h"
#include "wavecomb/render/inspection/picking.h"
#include "wavecomb/render/snapshot.h"
#include "wavecomb/render/statistics/process_memory.h"

namespace wavecomb {
namespace {

/// Returns the names of the ids in the Cryptomatte layers among `layers`.
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

RenderRun::RenderRun(std::shared_ptr<const Scene> scene, const RenderPlan& plan,
                     const RenderOptions& options, Watch& watch, double build_s,
                     std::optional<TransportChoice> transport)
    : scene_(std::move(scene)),
      plan_(plan),
      options_(options),
      watch_(watch),
      build_s_(build_s),
      transport_(std::move(transport)),
      costs_(*scene_, plan.traits, plan.settings),
      film_(plan.make_film()),
      joint_(plan.joint, plan.settings),
      context_(plan.make_context(film_, costs_, options.recorder, joint_)),
      integrator_(make_integrator(plan.settings.integrator, context_, plan.waves.lanes,
                                  plan.waves.threads, plan.waves.wave_size)),
      runner_(*integrator_, plan.waves.threads, plan.waves.wave_size),
      loop_(plan, resume(), film_, runner_, costs_, watch, joint_) {}

PassState RenderRun::resume() {
  PassState pass;
  if (options_.resume) learned_before_ = options_.resume(film_, pass);
  if (learned_before_.empty() && needs_training(plan_.settings)) learned_before_ = options_.learned;
  return pass;
}

CameraPathPart RenderRun::camera_part() const {
  if (!plan_.settings.joins_light()) return {};
  return transport_ ? transport_->camera : kUnknownCameraPart;
}

void RenderRun::work(PilotCache& cache, const PilotShared& shared,
                     const std::function<void(const PilotResults&)>& learned) {
  const auto stopped = [this] { return watch_.stopped(); };
  pilots_ = run_pilots(
      {
          .scene = scene_,
          .plan = plan_,
          .context = context_,
          .costs = costs_,
          .profile = options_.profile,
          .light_settings = shared.image ? *shared.image : plan_.settings,
          .camera = camera_part(),
          .learned = learned_before_,
          .joint = shared.joint ? *shared.joint : nullptr,
          .stopped = stopped,
          .halted = [this] { return watch_.halted(); },
      },
      cache);
  pilots_.apply(context_);
  if (shared.joint) *shared.joint = pilots_.joint;
  // Set camera_squares only after the pilots, because light splats then hold squared contributions,
  // but pilots measure light.
  if (options_.wants_camera_squares) plan_.joint.measure_squares(context_.joint);
  if (!stopped()) learned(pilots_);
  loop_.run();
}

void RenderRun::run(PilotCache& cache, const PilotShared& shared,
                    const std::function<void(const PilotResults&)>& learned) {
  const uint32_t threads = plan_.waves.threads;
  const tbb::global_control parallelism(
      tbb::global_control::max_allowed_parallelism,
      std::max<size_t>(threads, static_cast<size_t>(tbb::info::default_concurrency())));
  const auto in_arena = [&] {
    const TaskOrder order;
    tbb::task_arena(static_cast<int>(threads)).execute(order.around([&] {
      work(cache, shared, learned);
    }));
    order.join();
  };
  watch_.run(
      in_arena,
      [&] {
        check_textures();
        return options_.progress ? options_.progress(loop_.status()) : Request::kContinue;
      },
      [&] { take_snapshot(false); });
  check_textures();
  if (options_.progress && !watch_.stopped()) options_.progress(loop_.status());
  take_snapshot(true);
}

void RenderRun::take_snapshot(bool is_finished) {
  check_textures();
  film_.update_splat_aovs();
  if (!options_.snapshot) return;
  options_.snapshot({film_, loop_.pass(), *pilots_.training, transport_, loop_.status(),
                     is_finished, plan_.aovs.layer_names, [this] { return statistics(); }});
}

void RenderRun::check_textures() const {
  if (const TileStore* store = scene_->texture_store()) store->check();
}

RenderStatistics RenderRun::statistics() const {
  RenderStatistics s;
  s.build_s = build_s_;
  const double choice_s = transport_ ? transport_->seconds : 0;
  s.render_s = choice_s + seconds_since(start_);
  s.first_samples_s = choice_s + runner_.first_samples_s();
  s.threads = plan_.waves.threads;
  s.wave_size = plan_.waves.wave_size;
  s.cancelled = watch_.stopped();
  const RenderStatus status = loop_.status();
  s.passes = status.passes;
  s.resumed_samples = status.resumed_samples;
  s.error = status.error;
  s.allotment = loop_.allocation();
  s.guiding = pilots_.training->statistics;
  plan_.joint.report(pilots_.joint.get(), s);
  s.transport = transport_;
  add_up(runner_, context_, *scene_, costs_, s);
  s.scene_bytes = scene_->bytes();
  s.accelerator_bytes = plan_.accelerator.bytes();
  s.film_bytes = film_.bytes();
  if (pilots_.lights) s.light_calibration = light_shares(*pilots_.lights);
  s.peak_rss_bytes = peak_rss_bytes();
  if (const TileStore* store = scene_->texture_store()) s.texture_store = store->statistics();
  return s;
}

RenderedImage RenderRun::finish(RenderStatistics& statistics) {
  RenderedImage image;
  image.width = plan_.window.width();
  image.height = plan_.window.height();
  if (!options_.wants_picture) return image;
  ErrorMap error;
  error.mean_relative = std::numeric_limits<double>::infinity();
  if (film_.has_error()) error = measure_error(film_);
  statistics.error = error.mean_relative;
  Film::Layers layers = std::move(film_).finish(plan_.aovs.layer_names);
  statistics.peak_rss_bytes = peak_rss_bytes();
  image.beauty = std::move(layers.beauty);
  image.albedo = std::move(layers.albedo);
  image.normal = std::move(layers.normal);
  image.depth = std::move(layers.depth);
  image.samples = std::move(layers.samples);
  image.error = std::move(error.error);
  image.variance = std::move(layers.variance);
  image.aovs = std::move(layers.aovs);
  image.deep = std::move(layers.deep);
  image.manifests = crypto_manifests(*scene_, image.aovs);
  return image;
}

}  // namespace wavecomb
