// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/render/pilots/guiding_pilot.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <numeric>

#include "wavecomb/render/lane_kernels.h"
#include "wavecomb/render/passes/pass_runner.h"

namespace wavecomb {
namespace {

constexpr std::array<uint32_t, 2> kTrialSeeds = {0x6c078965u, 0x9908b0dfu};
/// Fraction of pixels with the largest differences that are left out.
constexpr double kUncounted = 0.005;
/// Paths whose vertices are held at once: about 30 MB.
constexpr size_t kPathsAtOnce = 65'536;

/// Returns the cost of the work that an integrator has done, in rays traced through a BVH.
double cost_of(const Integrator& integrator, const WaveSetup& waves, bool has_list, bool looks_up) {
  double rays = 0, records = 0;
  for (uint32_t i = 0; i < waves.threads; ++i)
    if (const Counts* c = integrator.worker(i).counts) {
      rays += static_cast<double>(c->rays + c->shadow_rays);
      records += static_cast<double>(c->records);
    }
  return (has_list ? kListRay : 1) * rays + (kShadingRays + (looks_up ? kGuidedRays : 0)) * records;
}

}  // namespace

std::vector<uint32_t> some_pixels(const std::vector<uint32_t>& order, uint64_t count) {
  if (count >= order.size()) return order;
  std::vector<uint32_t> pixels(count);
  for (uint64_t i = 0; i < count; ++i) pixels[i] = order[i * order.size() / count];
  return pixels;
}

double mean_without_largest(std::vector<double>& values, double share) {
  std::sort(values.begin(), values.end());
  const auto counted =
      static_cast<std::ptrdiff_t>(static_cast<double>(values.size()) * (1 - share));
  return std::accumulate(values.begin(), values.begin() + counted, 0.0) /
         static_cast<double>(std::max<std::ptrdiff_t>(counted, 1));
}

double teach(WaveContext context, const WaveSetup& waves, std::span<const uint32_t> pixels,
             const LessonPlan& plan, Lessons& lessons, const std::function<bool()>& stopped) {
  // An integrator records vertices only if there is a reader when it is made.
  BounceReader nobody({}, plan);
  context.histories = &nobody;
  const std::unique_ptr<Integrator> integrator = make_integrator(
      context.settings->integrator, context, waves.lanes, waves.threads, waves.wave_size);
  PassRunner runner(*integrator, waves.threads, waves.wave_size);
  const size_t step = std::max<size_t>(1, kPathsAtOnce / plan.samples);
  lessons.bounces.clear();
  lessons.luminances.clear();
  lessons.paths.clear();
  for (size_t at = 0; at < pixels.size() && !stopped(); at += step) {
    const auto some = pixels.subspan(at, std::min(step, pixels.size() - at));
    PassPlan pass;
    pass.pixels.assign(some.begin(), some.end());
    pass.batches.push_back({0, pass.pixels.size(), plan.first, plan.samples});
    BounceReader reader(pass.pixels, plan);
    context.histories = &reader;
    runner.run(pass, stopped);
    reader.append_to(lessons);
  }
  return cost_of(*integrator, waves, context.accel->has_list(), context.guide != nullptr);
}

Trial try_out(WaveContext context, Settings settings, const WaveSetup& waves,
              const PilotRenderPlan& plan, const std::function<bool()>& stopped) {
  const std::span<const uint32_t> pixels = plan.pixels;
  const uint32_t samples = plan.samples;
  Trial trial;
  trial.samples = samples;
  trial.differences.resize(pixels.size());
  context.settings = &settings;
  context.guide = plan.guide;
  for (const uint32_t seed : kTrialSeeds) {
    settings.seed = seed;
    Lessons lessons;
    const LessonPlan lesson_plan{0, samples, 0, plan.grid, {}, nullptr, {}, 1};
    trial.cost += teach(context, waves, pixels, lesson_plan, lessons, stopped);
    if (stopped()) return trial;
    const double sign = (seed == kTrialSeeds[0] ? 1.0 : -1.0) / samples;
    for (size_t i = 0; i < pixels.size(); ++i)
      for (uint32_t s = 0; s < samples; ++s)
        trial.differences[i] += sign * double{lessons.luminances[i * samples + s]};
  }
  return trial;
}

double error_of(const Trial& trial, std::span<const uint32_t> pixels, const PictureTiles& tiles) {
  std::vector<double> errors(pixels.size());
  for (size_t i = 0; i < pixels.size(); ++i) {
    const double d = trial.differences[i] * tiles.inverse_scale(pixels[i]);
    errors[i] = std::isfinite(d) ? d * d : 0;
  }
  return mean_without_largest(errors, kUncounted);
}

}  // namespace wavecomb
