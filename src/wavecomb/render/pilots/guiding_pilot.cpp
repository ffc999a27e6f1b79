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

constexpr std::array<uint32_t, 2> kPilotSeeds = {0x6c078965u, 0x9908b0dfu};
/// Fraction of pixels with the largest differences that are left out. A pilot render has a few
/// hundred pixels, of which a few noisy ones would otherwise determine the result.
constexpr double kUncounted = 0.02;
/// Paths whose vertices are held at once: about 30 MB.
constexpr size_t kPathsAtOnce = 65'536;

/// Returns the cost of the work that an integrator has done, in rays traced through a BVH.
double cost_of(const Integrator& integrator, const WaveSetup& waves, bool has_list,
               bool uses_field) {
  double rays = 0, records = 0;
  for (uint32_t i = 0; i < waves.threads; ++i)
    if (const Counts* c = integrator.worker(i).counts) {
      rays += static_cast<double>(c->rays + c->shadow_rays);
      records += static_cast<double>(c->records);
    }
  return (has_list ? kListRay : 1) * rays +
         (kShadingRays + (uses_field ? kGuidedRays : 0)) * records;
}

}  // namespace

std::vector<uint32_t> subset_of_pixels(const std::vector<uint32_t>& order, uint64_t count) {
  if (count >= order.size()) return order;
  std::vector<uint32_t> pixels(count);
  for (uint64_t i = 0; i < count; ++i) pixels[i] = order[i * order.size() / count];
  return pixels;
}

double trimmed_mean(std::vector<double>& values, double share) {
  std::sort(values.begin(), values.end());
  const auto counted =
      static_cast<std::ptrdiff_t>(static_cast<double>(values.size()) * (1 - share));
  return std::accumulate(values.begin(), values.begin() + counted, 0.0) /
         static_cast<double>(std::max<std::ptrdiff_t>(counted, 1));
}

double trace_training_paths(WaveContext context, const WaveSetup& waves,
                            std::span<const uint32_t> pixels, const TrainingPlan& plan,
                            TrainingSamples& training_samples,
                            const std::function<bool()>& stopped) {
  // An integrator records vertices only if there is a reader when it is made.
  BounceReader no_reader({}, plan);
  context.histories = &no_reader;
  const std::unique_ptr<Integrator> integrator = make_integrator(
      context.settings->integrator, context, waves.lanes, waves.threads, waves.wave_size);
  PassRunner runner(*integrator, waves.threads, waves.wave_size);
  const size_t step = std::max<size_t>(1, kPathsAtOnce / plan.samples);
  training_samples.bounces.clear();
  training_samples.luminances.clear();
  training_samples.paths.clear();
  for (size_t at = 0; at < pixels.size() && !stopped(); at += step) {
    const auto subset = pixels.subspan(at, std::min(step, pixels.size() - at));
    PassPlan pass;
    pass.pixels.assign(subset.begin(), subset.end());
    pass.batches.push_back({0, pass.pixels.size(), plan.first, plan.samples});
    BounceReader reader(pass.pixels, plan);
    context.histories = &reader;
    runner.run(pass, stopped);
    reader.append_to(training_samples);
  }
  return cost_of(*integrator, waves, context.accel->has_list(), context.guide != nullptr);
}

PilotRender render_pilot(WaveContext context, Settings settings, const WaveSetup& waves,
                         const PilotRenderPlan& plan, const std::function<bool()>& stopped) {
  const std::span<const uint32_t> pixels = plan.pixels;
  const uint32_t samples = plan.samples;
  PilotRender pilot;
  pilot.samples = samples;
  pilot.differences.resize(pixels.size());
  context.settings = &settings;
  context.guide = plan.guide;
  for (const uint32_t seed : kPilotSeeds) {
    settings.seed = seed;
    TrainingSamples training_samples;
    const TrainingPlan lesson_plan{0, samples, 0, plan.grid, {}, nullptr, {}, 1};
    pilot.cost +=
        trace_training_paths(context, waves, pixels, lesson_plan, training_samples, stopped);
    if (stopped()) return pilot;
    const double sign = (seed == kPilotSeeds[0] ? 1.0 : -1.0) / samples;
    for (size_t i = 0; i < pixels.size(); ++i)
      for (uint32_t s = 0; s < samples; ++s)
        pilot.differences[i] += sign * double{training_samples.luminances[i * samples + s]};
  }
  return pilot;
}

double error_of(const PilotRender& pilot, std::span<const uint32_t> pixels,
                const ImageTiles& tiles) {
  std::vector<double> errors(pixels.size());
  for (size_t i = 0; i < pixels.size(); ++i) {
    const double d = pilot.differences[i] * tiles.inverse_scale(pixels[i]);
    errors[i] = std::isfinite(d) ? d * d : 0;
  }
  return trimmed_mean(errors, kUncounted);
}

}  // namespace wavecomb
