// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/render/renderer.h"

#include <sys/resource.h>
#include <tbb/global_control.h>
#include <tbb/info.h>
#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <condition_variable>
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

/// Paths a wave holds unless told otherwise, and samples of a pixel that a pass adds.
constexpr uint32_t kDefaultWaveSize = 4096;
constexpr uint32_t kPassSamples = 16;

using WaveFunction = void (*)(Wave&, const WaveContext&, const WaveTask&);

WaveFunction wave_function(uint32_t lanes) {
  switch (lanes) {
#ifdef WAVECOMB_HAS_LANES_1
    case 1: return &run_wave<1>;
#endif
#ifdef WAVECOMB_HAS_LANES_4
    case 4: return &run_wave<4>;
#endif
#ifdef WAVECOMB_HAS_LANES_8
    case 8: return &run_wave<8>;
#endif
#ifdef WAVECOMB_HAS_LANES_16
    case 16: return &run_wave<16>;
#endif
    default: return nullptr;
  }
}

uint32_t choose_lanes(uint32_t wanted) {
  const std::vector<uint32_t> built = lane_widths();
  if (wanted == 0) return built.back();
  if (std::find(built.begin(), built.end(), wanted) != built.end()) return wanted;
  std::string list;
  for (uint32_t w : built) list += (list.empty() ? "" : ", ") + std::to_string(w);
  throw Error("lanes is " + std::to_string(wanted) + ", which this build has no kernels for; it has " +
              list);
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

const RenderStatistics& WavefrontRenderer::statistics() const { return impl_->statistics; }

Picture WavefrontRenderer::render(const Settings& settings, const ProgressCallback& progress) {
  settings.check();
  const uint32_t lanes = choose_lanes(settings.lanes);
  const uint32_t threads =
      settings.threads != 0 ? settings.threads : static_cast<uint32_t>(tbb::info::default_concurrency());
  const auto policy = make_policy(settings.policy);
  const CostSnapshot costs;
  const FilterTable filter(settings.filter, settings.filter_width);
  const CameraSetup camera(impl_->scene->camera(), settings.width, settings.height, filter);
  Film film(settings.width, settings.height, true);
  const std::vector<uint32_t> pixels = morton_pixel_order(settings.width, settings.height);
  const bool reference = settings.integrator == IntegratorKind::kReference;

  // A wave is no larger than what keeps every worker busy a few times over.
  const uint64_t total = uint64_t{settings.spp} * pixels.size();
  const uint64_t share = std::max<uint64_t>(64, total / (uint64_t{threads} * 4));
  const uint32_t wave_size = static_cast<uint32_t>(
      std::min<uint64_t>(settings.wave_size != 0 ? settings.wave_size : kDefaultWaveSize, share));
  // At least enough samples a pass for a wave to be full when the picture is smaller than a wave.
  const uint32_t fill = static_cast<uint32_t>((wave_size + pixels.size() - 1) / pixels.size());
  const uint32_t pass_samples =
      std::min({settings.spp, wave_size, std::max(kPassSamples, fill)});
  const uint32_t pixels_per_wave = std::max(1u, wave_size / pass_samples);

  const WaveContext context{impl_->scene->view(),
                            impl_->accel.get(),
                            &settings,
                            &camera,
                            policy.get(),
                            &costs,
                            &film,
                            settings.traversal == Traversal::kSingle
                                ? 1u
                                : std::min(lanes, impl_->accel->native_width())};
  const WaveFunction wave_function_ = wave_function(lanes);

  std::vector<Worker> workers(threads);
  std::atomic<uint64_t> done{0};
  std::atomic<bool> cancel{false};
  const Clock::time_point start = Clock::now();

  const auto run_task = [&](const WaveTask& task) {
    Worker& worker = workers[static_cast<size_t>(tbb::this_task_arena::current_thread_index())];
    const DenormalsOff denormals_off;
    if (reference) {
      run_reference(context, task, worker.clock, worker.counts);
    } else {
      if (!worker.wave) worker.wave = std::make_unique<Wave>(wave_size, true);
      wave_function_(*worker.wave, context, task);
    }
    done += task.path_count();
  };
  const auto run_passes = [&] {
    const size_t waves = (pixels.size() + pixels_per_wave - 1) / pixels_per_wave;
    for (uint32_t first = 0; first < settings.spp && !cancel; first += pass_samples) {
      const uint32_t samples = std::min(pass_samples, settings.spp - first);
      tbb::parallel_for(
          tbb::blocked_range<size_t>(0, waves, 1),
          [&](const tbb::blocked_range<size_t>& range) {
            for (size_t w = range.begin(); w != range.end() && !cancel; ++w) {
              const size_t begin = w * pixels_per_wave;
              const auto count = static_cast<uint32_t>(
                  std::min<size_t>(pixels_per_wave, pixels.size() - begin));
              run_task({pixels.data() + begin, count, first, samples});
            }
          },
          tbb::simple_partitioner());
    }
  };

  // The work runs in an arena that a thread of its own enters; this one watches, reports and cancels.
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
  s.threads = threads;
  s.wave_size = wave_size;
  s.lanes = reference ? 1 : lanes;
  s.cancelled = cancel;
  PhaseClock clock;
  Counts counts;
  for (const Worker& worker : workers) {
    clock.add(worker.clock);
    counts.add(worker.counts);
    if (!worker.wave) continue;
    clock.add(worker.wave->clock);
    counts.add(worker.wave->counts);
    s.wave_bytes += worker.wave->bytes();
  }
  for (size_t i = 0; i < kPhaseCount; ++i)
    s.phases_s.emplace_back(kPhaseNames[i], 1e-9 * static_cast<double>(clock.ns()[i]));
  s.samples = counts.samples;
  s.rays = counts.rays;
  s.shadow_rays = counts.shadow_rays;
  s.records = counts.records;
  s.packets = counts.packets;
  s.packet_lanes = counts.packet_lanes;
  s.accelerator_bytes = impl_->accel->bytes();
  s.peak_rss_bytes = peak_rss_bytes();

  return {settings.width, settings.height, film.beauty(), film.albedo(),
          film.normal(),  film.depth(),    film.samples()};
}

std::vector<uint32_t> lane_widths() {
  std::vector<uint32_t> widths;
  for (uint32_t w : {1u, 4u, 8u, 16u})
    if (wave_function(w)) widths.push_back(w);
  return widths;
}

uint64_t peak_rss_bytes() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
#ifdef __APPLE__
  return static_cast<uint64_t>(usage.ru_maxrss);
#else
  return static_cast<uint64_t>(usage.ru_maxrss) * 1024;
#endif
}

}  // namespace wavecomb
