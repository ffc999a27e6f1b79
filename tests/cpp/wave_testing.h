// SPDX-License-Identifier: Apache-2.0
/// Running waves by hand, without the renderer and threads.
#pragma once

#include "scene_testing.h"
#include "wavecomb/core/denormals.h"
#include "wavecomb/light/tree/light_tree.h"
#include "wavecomb/material/energy_tables.h"
#include "wavecomb/reference/reference.h"
#include "wavecomb/render/lane_kernels.h"
#include "wavecomb/render/passes/pixel_order.h"
#include "wavecomb/render/render_plan.h"
#include "wavecomb/wave/wave.h"

namespace wavecomb::wave_testing {

inline constexpr uint32_t kReferenceLanes = 0;

/// Parameters of a run: settings, kernel lanes (0 for the reference integrator), and packet width.
struct WaveCase {
  Settings settings;
  uint32_t lanes = kReferenceLanes;
  uint32_t traversal = 1;
};

/// A scene, its accelerator and a film, ready to run waves on this thread.
class WaveRun {
 public:
  /// `histories` receives the vertices of paths.
  WaveRun(std::shared_ptr<const Scene> scene, const WaveCase& wave_case,
          std::shared_ptr<const EmbreeAccelerator> accel = nullptr,
          HistoryReader* histories = nullptr)
      : case_(wave_case),
        scene_(std::move(scene)),
        accel_(accel ? std::move(accel) : std::make_shared<const EmbreeAccelerator>(scene_, 1u)),
        filter_(case_.settings.filter, case_.settings.used_filter_width()),
        camera_(scene_->camera(), case_.settings.width, case_.settings.height, filter_),
        traits_(material_traits(*scene_)),
        costs_(model_costs(*scene_)),
        aovs_(*scene_, case_.settings),
        film_(case_.settings.width, case_.settings.height, aovs_.layout),
        pixels_(morton_pixel_order(case_.settings.rendered())) {
    for (const std::string& name : policy_names())
      if (name != "adaptive" &&
          (case_.settings.policy == "adaptive" || case_.settings.policy == name))
        policies_.push_back(make_policy(name));
    for (const auto& policy : policies_) {
      context_policies_.push_back(policy.get());
      context_.wants_position |= (policy->columns() & kPositionColumn) != 0;
    }
    context_.scene = scene_->view();
    context_.scene.materials.energy = energy_tables(scene_->materials());
    context_.scene.lights.by_tree =
        chooses_by_tree(case_.settings.light_selection, context_.scene.lights);
    if (context_.scene.lights.by_tree) context_.scene.lights.tree = scene_->light_tree(1).view();
    context_.accel = accel_.get();
    context_.settings = &case_.settings;
    context_.camera = &camera_;
    context_.policies = context_policies_;
    context_.traits = traits_;
    context_.costs = context_.roulette_costs = &costs_;
    context_.film = &film_;
    context_.aovs = &aovs_;
    context_.traversal_width = case_.traversal;
    context_.measures_costs = true;
    context_.histories = histories;
    reference_ = std::make_unique<ReferenceIntegrator>(context_, 1);
    context_.grid = order_grid(scene_->bounds());
  }
  WaveRun(const WaveRun&) = delete;
  WaveRun& operator=(const WaveRun&) = delete;

  /// Runs all samples in waves of at most `wave_size` paths and passes of at most `pass` samples.
  void all(uint32_t wave_size, uint32_t pass = 16) {
    if (case_.lanes != kReferenceLanes) reserve(wave_size);
    each_task(wave_size, pass, [&](const WaveTask& task) { run(task); });
  }

  /// Calls one(task) for the tasks of all samples.
  template <typename One>
  void each_task(uint32_t wave_size, uint32_t pass, const One& one) {
    const DenormalsOff denormals_off;
    const Settings& s = case_.settings;
    pass = std::min(pass, wave_size);
    const uint32_t step = std::max(1u, wave_size / pass);
    const auto count = static_cast<uint32_t>(pixels_.size());
    for (uint32_t first = 0; first < s.spp; first += pass)
      for (uint32_t p = 0; p < count; p += step)
        one(WaveTask{pixels_.data() + p, std::min(step, count - p), first,
                     std::min(pass, s.spp - first)});
  }

  /// Nanoseconds to shade synthetic hits of one material with kernels of W lanes.
  template <size_t W>
  double time_material(const CalibrationHits& hits) {
    const DenormalsOff denormals_off;
    reserve(hits.count);
    return wavecomb::time_material<W>(*wave_, context_, hits);
  }

  RenderedImage image() const {
    Film::Layers layers = Film(film_).finish(aovs_.layer_names);
    RenderedImage image;
    image.width = case_.settings.width;
    image.height = case_.settings.height;
    image.beauty = std::move(layers.beauty);
    image.albedo = std::move(layers.albedo);
    image.normal = std::move(layers.normal);
    image.depth = std::move(layers.depth);
    image.samples = std::move(layers.samples);
    image.aovs = std::move(layers.aovs);
    return image;
  }
  const Wave& wave() const { return *wave_; }
  /// Allocates buffers for waves of `size` paths.
  Wave& reserve(uint32_t size) {
    if (!wave_ || size > capacity_) {
      wave_ = std::make_unique<Wave>(size, context_);
      capacity_ = size;
    }
    return *wave_;
  }
  const WaveContext& context() const { return context_; }
  /// Enables guiding. Contract: call before reserve; the field must outlive the run.
  void guide(const GuidingView& view) { context_.guide = &view; }
  /// Replaces the trails of the light tree, which only the pdf of a light that was hit needs.
  /// Contract: `trails` has an entry for each light and must outlive the run.
  void replace_trails(const std::vector<uint32_t>& trails) {
    context_.scene.lights.tree.trails = trails.data();
  }
  Film& film() { return film_; }
  const Counts& reference_counts() const { return *reference_->worker(0).counts; }

 private:
  void run(const WaveTask& task) {
    if (case_.lanes != kReferenceLanes && context_.scene.volumes.count > 0)
      return lane_kernels(case_.lanes).run_in_volumes(*wave_, context_, task);
    switch (case_.lanes) {
      case kReferenceLanes:
        return reference_->run(0, task);
#ifdef WAVECOMB_HAS_LANES_1
      case 1:
        return run_wave<1>(*wave_, context_, task);
#endif
#ifdef WAVECOMB_HAS_LANES_4
      case 4:
        return run_wave<4>(*wave_, context_, task);
#endif
#ifdef WAVECOMB_HAS_LANES_8
      case 8:
        return run_wave<8>(*wave_, context_, task);
#endif
#ifdef WAVECOMB_HAS_LANES_16
      case 16:
        return run_wave<16>(*wave_, context_, task);
#endif
      default:
        FAIL() << "no kernels for " << case_.lanes << " lanes";
    }
  }

  WaveCase case_;
  std::shared_ptr<const Scene> scene_;
  std::shared_ptr<const EmbreeAccelerator> accel_;
  FilterTable filter_;
  CameraSetup camera_;
  std::vector<MaterialTraits> traits_;
  CostSnapshot costs_;
  AovTables aovs_;
  Film film_;
  std::vector<uint32_t> pixels_;
  std::unique_ptr<Wave> wave_;
  uint32_t capacity_ = 0;
  std::vector<std::unique_ptr<SchedulingPolicy>> policies_;
  std::vector<const SchedulingPolicy*> context_policies_;
  WaveContext context_{};
  std::unique_ptr<ReferenceIntegrator> reference_;
};

}  // namespace wavecomb::wave_testing
