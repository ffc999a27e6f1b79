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
#include "wavecomb/render/pilots/planner.h"
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
  RenderedImage render(const PlannedSettings& planned, const RenderOptions& options, Watch& watch);
};

namespace {

/// While an object of this class exists, the renderer counts as rendering.
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

RenderedImage WavefrontRenderer::render(const Settings& settings, const RenderOptions& options) {
  settings.check();
  Watch watch(options.interval_s);
  const Running running(*impl_, watch);
  Planner planner(impl_->scene, impl_->accel, impl_->build_s, impl_->pilot_cache);
  return impl_->render(planner.plan(settings, options, [&] { return watch.stopped(); }), options,
                       watch);
}

RenderedImage WavefrontRenderer::Impl::render(const PlannedSettings& planned,
                                              const RenderOptions& options, Watch& watch) {
  const RenderPlan plan(*scene, *accel, planned.settings, planned.share, options.policy);
  RenderRun run(scene, plan, options, watch, build_s, planned.choice);
  run.run(pilot_cache, {}, [&](const PilotResults& found) {
    const std::lock_guard lock(mutex);
    learned = std::make_shared<const Learned>(
        Learned{scene, plan.view.lights.by_tree, found.lights, found.training, planned.choice});
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
