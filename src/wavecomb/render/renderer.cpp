// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/render/renderer.h"

#include <sys/resource.h>
#ifdef __GLIBC__
#include <malloc.h>
#endif
#include <tbb/global_control.h>
#include <tbb/info.h>
#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <condition_variable>
#include <fstream>
#include <mutex>
#include <thread>

#include "wavecomb/core/denormals.h"
#include "wavecomb/core/error.h"
#include "wavecomb/integrate/reference.h"
#include "wavecomb/integrate/wave.h"
#include "wavecomb/render/pixel_order.h"

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

/// The kernels of one width.
struct LaneKernels {
  void (*run)(Wave&, const WaveContext&, const WaveTask&) = nullptr;
  double (*time_material)(Wave&, const WaveContext&, const CalibrationHits&) = nullptr;
};

LaneKernels lane_kernels(uint32_t lanes) {
  switch (lanes) {
#ifdef WAVECOMB_HAS_LANES_1
    case 1:
      return {&run_wave<1>, &time_material<1>};
#endif
#ifdef WAVECOMB_HAS_LANES_4
    case 4:
      return {&run_wave<4>, &time_material<4>};
#endif
#ifdef WAVECOMB_HAS_LANES_8
    case 8:
      return {&run_wave<8>, &time_material<8>};
#endif
#ifdef WAVECOMB_HAS_LANES_16
    case 16:
      return {&run_wave<16>, &time_material<16>};
#endif
    default:
      return {};
  }
}

uint32_t choose_lanes(uint32_t wanted) {
  const std::vector<uint32_t> built = lane_widths();
  if (wanted == 0) return built.back();
  if (std::find(built.begin(), built.end(), wanted) != built.end()) return wanted;
  std::string list;
  for (uint32_t w : built) list += (list.empty() ? "" : ", ") + std::to_string(w);
  throw Error("lanes is " + std::to_string(wanted) + ", which the " + library_name() +
              " library has no kernels for; it has " + list);
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

void apply_profile(const Scene& scene, const CostProfile& profile, CostSnapshot& costs) {
  const auto find = [](const auto& entries, const std::string& name) {
    for (const auto& [entry, ns] : entries)
      if (entry == name) return ns;
    return 0.f;
  };
  for (size_t m = 0; m < costs.material_ns.size(); ++m)
    if (const float ns = find(profile.materials, scene.materials()[m].name); ns > 0)
      costs.material_ns[m] = ns;
  for (size_t t = 0; t < costs.texture_ns.size(); ++t)
    if (const float ns = find(profile.textures, scene.textures()[t]->name()); ns > 0)
      costs.texture_ns[t] = ns;
  double sum = 0;
  for (float ns : costs.material_ns) sum += ns;
  costs.mean_ns = static_cast<float>(sum / static_cast<double>(costs.material_ns.size()));
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

/// What one worker owns.
struct Worker {
  std::unique_ptr<Wave> wave;
  PhaseClock clock;
  Counts counts;
};

}  // namespace

struct WavefrontRenderer::Impl {
  std::shared_ptr<const Scene> scene;
  std::unique_ptr<EmbreeAccelerator> accel;
  RenderStatistics statistics;
  CostSnapshot costs;  ///< after the last render
  double build_s = 0;

  /// Costs measured on synthetic hits: the quickest of three runs each.
  CostSnapshot calibrate(Wave& wave, const WaveContext& context, const LaneKernels& kernels) const;
};

CostSnapshot WavefrontRenderer::Impl::calibrate(Wave& wave, const WaveContext& context,
                                                const LaneKernels& kernels) const {
  CostSnapshot costs = model_costs(*scene);
  CostTracker tracker(context.traits.size());
  for (CalibrationHits& hits : find_calibration_hits(*scene)) {
    hits.count = std::min<uint32_t>(256, static_cast<uint32_t>(wave.rays.capacity()));
    double ns = kernels.time_material(wave, context, hits);
    for (int repeat = 0; repeat < 2; ++repeat)
      ns = std::min(ns, kernels.time_material(wave, context, hits));
    const std::vector<uint32_t> materials(hits.count, hits.material);
    tracker.charge(materials, ns);
  }
  std::fill(costs.texture_ns.begin(), costs.texture_ns.end(), 0.f);
  merge_costs(tracker, context.traits, 1.f, costs);
  return costs;
}

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

CostProfile WavefrontRenderer::cost_profile() const {
  CostProfile profile;
  const CostSnapshot& costs = impl_->costs;
  for (size_t m = 0; m < costs.material_ns.size(); ++m)
    profile.materials.emplace_back(impl_->scene->materials()[m].name, costs.material_ns[m]);
  for (size_t t = 0; t < costs.texture_ns.size(); ++t)
    profile.textures.emplace_back(impl_->scene->textures()[t]->name(), costs.texture_ns[t]);
  return profile;
}

Picture WavefrontRenderer::render(const Settings& settings, const ProgressCallback& progress,
                                  const SchedulingPolicy* own_policy, const CostProfile* profile,
                                  RayRecorder* recorder) {
  settings.check();
  const Scene& scene = *impl_->scene;
  const uint32_t lanes = choose_lanes(settings.lanes);
  const LaneKernels kernels = lane_kernels(lanes);
  const uint32_t threads = settings.threads != 0
                               ? settings.threads
                               : static_cast<uint32_t>(tbb::info::default_concurrency());
  std::vector<std::unique_ptr<SchedulingPolicy>> owned;
  std::vector<const SchedulingPolicy*> policies;
  if (own_policy) {
    policies.push_back(own_policy);
  } else {
    owned = choose_policies(settings.policy);
    for (const auto& policy : owned) policies.push_back(policy.get());
  }
  const bool wants_position = std::any_of(policies.begin(), policies.end(), [](const auto* policy) {
    return (policy->columns() & kPositionColumn) != 0;
  });
  const std::vector<MaterialTraits> traits = material_traits(scene);
  CostSnapshot& costs = impl_->costs;
  costs = model_costs(scene);
  const FilterTable filter(settings.filter, settings.filter_width);
  const CameraSetup camera(scene.camera(), settings.width, settings.height, filter);
  const AovTables aovs(scene, settings);
  Film film(settings.width, settings.height, aovs.layout);
  const std::vector<uint32_t> pixels = morton_pixel_order(settings.width, settings.height);
  const bool reference = settings.integrator == IntegratorKind::kReference;

  // A wave is no larger than what keeps every worker busy a few times over.
  const uint64_t total = uint64_t{settings.spp} * pixels.size();
  const uint64_t share = std::max<uint64_t>(64, total / (uint64_t{threads} * 4));
  const uint32_t wave_size = static_cast<uint32_t>(
      std::min<uint64_t>(settings.wave_size != 0 ? settings.wave_size : kDefaultWaveSize, share));
  // At least enough samples a pass for a wave to be full when the picture is smaller than a wave.
  const uint32_t fill = static_cast<uint32_t>((wave_size + pixels.size() - 1) / pixels.size());
  const uint32_t pass_samples = std::min({settings.spp, wave_size, std::max(kPassSamples, fill)});
  const uint32_t pixels_per_wave = std::max(1u, wave_size / pass_samples);

  const bool measures = settings.costs != CostSource::kModel && !reference;
  CostSnapshot roulette_costs = costs;
  const WaveContext context{
      scene.view(),
      impl_->accel.get(),
      &settings,
      &camera,
      policies,
      traits,
      &costs,
      &roulette_costs,
      order_grid(scene.bounds()),
      &film,
      settings.traversal == Traversal::kSingle ? 1u : std::min(lanes, impl_->accel->native_width()),
      wants_position,
      measures,
      recorder,
      &aovs};

  std::vector<Worker> workers(threads);
  std::atomic<uint64_t> done{0};
  std::atomic<bool> cancel{false};
  const Clock::time_point start = Clock::now();
  double first_samples_s = 0;

  const auto run_task = [&](const WaveTask& task) {
    Worker& worker = workers[static_cast<size_t>(tbb::this_task_arena::current_thread_index())];
    const DenormalsOff denormals_off;
    if (reference) {
      run_reference(context, task, worker.clock, worker.counts);
    } else {
      if (!worker.wave) worker.wave = std::make_unique<Wave>(wave_size, context);
      kernels.run(*worker.wave, context, task);
    }
    if (done.fetch_add(task.path_count()) == 0) first_samples_s = seconds_since(start);
  };
  CostTracker measured(traits.size());  // of the pass
  std::vector<double> total_ns(traits.size());
  std::vector<uint64_t> total_timed(traits.size());
  CostPrediction prediction;
  CostSnapshot calibrated = costs;
  double calibration_s = 0;
  const auto start_costs = [&] {
    if (measures) {
      const DenormalsOff denormals_off;
      const Clock::time_point begin = Clock::now();
      Wave wave(std::max(wave_size, 256u), context);
      costs = impl_->calibrate(wave, context, kernels);
      calibration_s = seconds_since(begin);
    }
    if (profile) apply_profile(scene, *profile, costs);
    calibrated = costs;
    // Roulette decides over the picture: it keeps to costs that do not vary, unless told otherwise.
    if (settings.costs == CostSource::kMeasured || profile) roulette_costs = costs;
  };
  const auto merge_pass = [&] {
    for (Worker& worker : workers)
      if (worker.wave) measured.take(worker.wave->costs);
    for (size_t m = 0; m < traits.size(); ++m) {
      total_ns[m] += measured.ns()[m];
      total_timed[m] += measured.timed()[m];
    }
    if (!measures) return;
    const CostPrediction p = merge_costs(measured, traits, settings.cost_weight, costs);
    if (p.materials > 0) prediction = p;
    if (settings.costs == CostSource::kMeasured) roulette_costs = costs;
    measured = CostTracker(traits.size());
  };
  const auto run_passes = [&] {
    start_costs();
    const size_t waves = (pixels.size() + pixels_per_wave - 1) / pixels_per_wave;
    for (uint32_t first = 0; first < settings.spp && !cancel; first += pass_samples) {
      const uint32_t samples = std::min(pass_samples, settings.spp - first);
      tbb::parallel_for(
          tbb::blocked_range<size_t>(0, waves, 1),
          [&](const tbb::blocked_range<size_t>& range) {
            for (size_t w = range.begin(); w != range.end() && !cancel; ++w) {
              const size_t begin = w * pixels_per_wave;
              const auto count =
                  static_cast<uint32_t>(std::min<size_t>(pixels_per_wave, pixels.size() - begin));
              run_task({pixels.data() + begin, count, first, samples});
            }
          },
          tbb::simple_partitioner());
      merge_pass();
    }
  };

  // The work runs in an arena that a thread of its own enters; this one watches, reports and
  // cancels.
  const tbb::global_control parallelism(
      tbb::global_control::max_allowed_parallelism,
      std::max<size_t>(threads, static_cast<size_t>(tbb::info::default_concurrency())));
  std::mutex mutex;
  std::condition_variable finished;
  bool is_finished = false;
  std::exception_ptr failure;
  std::thread runner([&] {
    std::exception_ptr error;
    try {
      tbb::task_arena(static_cast<int>(threads)).execute(run_passes);
    } catch (...) {
      error = std::current_exception();
    }
    const std::lock_guard lock(mutex);
    failure = error;
    is_finished = true;
    finished.notify_all();
  });
  std::exception_ptr thrown;
  {
    std::unique_lock lock(mutex);
    while (!finished.wait_for(lock, std::chrono::milliseconds(100), [&] { return is_finished; })) {
      if (!progress) continue;
      lock.unlock();
      bool go_on = false;
      try {
        go_on = progress(done, total);
      } catch (...) {
        thrown = std::current_exception();
      }
      lock.lock();
      if (go_on) continue;
      cancel = true;
      finished.wait(lock, [&] { return is_finished; });
      break;
    }
  }
  runner.join();
  if (thrown) std::rethrow_exception(thrown);
  if (failure) std::rethrow_exception(failure);
  if (progress && !cancel) progress(done, total);

  RenderStatistics& s = impl_->statistics;
  s = {};
  s.build_s = impl_->build_s;
  s.render_s = seconds_since(start);
  s.first_samples_s = first_samples_s;
  s.threads = threads;
  s.wave_size = wave_size;
  s.lanes = reference ? 1 : lanes;
  s.cancelled = cancel;
  s.calibration_s = calibration_s;
  PhaseClock clock;
  Counts counts;
  CoherenceCounts coherence;
  std::vector<uint64_t> seen(traits.size()), uses(policies.size());
  for (const Worker& worker : workers) {
    clock.add(worker.clock);
    counts.add(worker.counts);
    if (!worker.wave) continue;
    const Wave& wave = *worker.wave;
    clock.add(wave.clock);
    counts.add(wave.counts);
    coherence.add(wave.coherence);
    s.wave_bytes += wave.bytes();
    for (size_t m = 0; m < traits.size(); ++m) seen[m] += wave.costs.seen()[m];
    for (size_t p = 0; p < policies.size(); ++p) uses[p] += wave.policy_chooser.used()[p];
  }
  for (size_t i = 0; i < kPhaseCount; ++i)
    s.phases_s.emplace_back(kPhaseNames[i], 1e-9 * static_cast<double>(clock.ns()[i]));
  s.samples = counts.samples;
  s.rays = counts.rays;
  s.shadow_rays = counts.shadow_rays;
  s.records = counts.records;
  s.packets = counts.packets;
  s.packet_lanes = counts.packet_lanes;
  const auto depths = [](const auto& at) {
    size_t n = at.size();
    while (n > 0 && at[n - 1] == 0) --n;
    return std::vector<uint64_t>(at.begin(), at.begin() + static_cast<std::ptrdiff_t>(n));
  };
  s.rays_at = depths(counts.rays_at);
  s.shadow_rays_at = depths(counts.shadow_rays_at);
  s.records_at = depths(counts.records_at);
  s.run_length = coherence.run_length();
  s.material_homogeneity = coherence.material_homogeneity();
  s.texture_homogeneity = coherence.texture_homogeneity();
  for (size_t m = 0; m < traits.size(); ++m) {
    MaterialStatistics material;
    material.name = scene.materials()[m].name;
    material.program = kProgramNames[traits[m].program];
    material.records = seen[m];
    material.timed_records = total_timed[m];
    if (total_timed[m] > 0)
      material.measured_ns = total_ns[m] / static_cast<double>(total_timed[m]);
    material.calibrated_ns = calibrated.material_ns[m];
    material.predicted_ns = costs.material_ns[m];
    s.materials.push_back(std::move(material));
  }
  s.cost_r2 = prediction.r2;
  s.cost_mean_error = prediction.mean_error;
  s.cost_materials = prediction.materials;
  if (policies.size() > 1)
    for (size_t p = 0; p < policies.size(); ++p)
      s.policy_uses.emplace_back(std::string(policies[p]->name()), uses[p]);
  s.scene_bytes = scene.bytes();
  s.accelerator_bytes = impl_->accel->bytes();
  s.film_bytes = film.bytes();
  Film::Layers layers = std::move(film).finish(aovs.kept_names);
  s.peak_rss_bytes = peak_rss_bytes();

  Picture picture{settings.width,
                  settings.height,
                  std::move(layers.beauty),
                  std::move(layers.albedo),
                  std::move(layers.normal),
                  std::move(layers.depth),
                  std::move(layers.samples),
                  std::move(layers.aovs),
                  {}};
  picture.manifests = crypto_manifests(scene, picture.aovs);
  return picture;
}

std::vector<uint32_t> lane_widths() {
  std::vector<uint32_t> widths;
  for (uint32_t w : {1u, 4u, 8u, 16u})
    if (lane_kernels(w).run) widths.push_back(w);
  return widths;
}

void give_back_memory() {
#ifdef __GLIBC__
  malloc_trim(0);
#endif
}

const char* library_name() {
  return WAVECOMB_LIBRARY;
}

uint64_t peak_rss_bytes() {
#ifdef __linux__
  // Not ru_maxrss, which begins with what the parent had when it started this process.
  std::ifstream status("/proc/self/status");
  for (std::string word; status >> word;)
    if (word == "VmHWM:") {
      uint64_t kilobytes = 0;
      status >> kilobytes;
      return kilobytes * 1024;
    }
#endif
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
#ifdef __APPLE__
  return static_cast<uint64_t>(usage.ru_maxrss);
#else
  return static_cast<uint64_t>(usage.ru_maxrss) * 1024;
#endif
}

}  // namespace wavecomb
