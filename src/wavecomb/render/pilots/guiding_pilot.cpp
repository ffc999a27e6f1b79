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
/// This fraction of the pixels is left out, namely the pixels with the largest differences. A pilot
/// render has a few hundred pixels, of which a few noisy ones would otherwise determine the result.
constexpr double kUncounted = 0.02;
/// Fraction of the paths that is left out of the variance: the paths with the largest differences.
constexpr double kTrimmedPaths = 0.001;
/// Number of paths whose vertices are stored at the same time, which takes about 30 MB.
constexpr size_t kPathsAtOnce = 65'536;
/// Number of groups of pixels from which log_ratio_error() estimates the error.
constexpr size_t kGroups = 10;

/// Stores the luminance of each path of a pilot render. The paths store no vertices, so that they
/// use the same kernels as the paths of the image.
///
/// Contract: workers may call ended() concurrently for different paths.
class LuminanceReader final : public HistoryReader {
 public:
  /// `pixels` outlives the reader. Each pixel has the samples [0, samples).
  LuminanceReader(std::span<const uint32_t> pixels, uint32_t samples)
      : pixels_(pixels), samples_(samples), luminances_(pixels.size() * samples) {}

  uint32_t most() const override { return 0; }
  void ended(const PathHistory& /*history*/, const float* radiance, const WaveTask& task) override {
    for (uint32_t slot = 0; slot < task.path_count(); ++slot) {
      const auto pixel = static_cast<size_t>(task.pixels - pixels_.data()) + slot / task.samples;
      luminances_[pixel * samples_ + task.first_sample + slot % task.samples] =
          luminance(load_row<RadianceRow, float>(radiance, slot, true).sum);
    }
  }
  /// Returns the mean luminance of pixel `i`, summed up in the order of samples.
  double mean(size_t i) const {
    double sum = 0;
    for (uint32_t s = 0; s < samples_; ++s) sum += double{luminances_[i * samples_ + s]};
    return sum / samples_;
  }

 private:
  std::span<const uint32_t> pixels_;
  uint32_t samples_;
  std::vector<float> luminances_;
};

/// Returns the cost of the work that an integrator has done, in units of one ray traced through a
/// BVH.
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
  // An integrator records vertices only if there is a HistoryReader when the integrator is created.
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

void PilotRender::append(const PilotRender& other) {
  differences.insert(differences.end(), other.differences.begin(), other.differences.end());
  cost += other.cost;
}

PilotRender render_pilot(WaveContext context, Settings settings, const WaveSetup& waves,
                         const PilotRenderPlan& plan, const std::function<bool()>& stopped) {
  PassPlan pass;
  pass.pixels.assign(plan.pixels.begin(), plan.pixels.end());
  pass.batches.push_back({0, pass.pixels.size(), 0, plan.samples});
  LuminanceReader reader(pass.pixels, plan.samples);
  PilotRender pilot;
  pilot.samples = plan.samples;
  pilot.differences.resize(pass.pixels.size());
  context.settings = &settings;
  context.guide = plan.guide;
  context.histories = &reader;
  const std::unique_ptr<Integrator> integrator =
      make_integrator(settings.integrator, context, waves.lanes, waves.threads, waves.wave_size);
  PassRunner runner(*integrator, waves.threads, waves.wave_size);
  for (const uint32_t seed : kPilotSeeds) {
    settings.seed = seed;
    runner.run(pass, stopped);
    if (stopped()) return pilot;
    for (size_t i = 0; i < pass.pixels.size(); ++i)
      pilot.differences[i] += seed == kPilotSeeds[0] ? reader.mean(i) : -reader.mean(i);
  }
  pilot.cost = cost_of(*integrator, waves, context.accel->has_list(), context.guide != nullptr);
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

PathStatistics mean_path(const TrainingSamples& training_samples, std::span<const uint32_t> pixels,
                         const ImageTiles& tiles, std::optional<double> spread) {
  PathStatistics mean;
  if (!tiles.is_lit() || pixels.size() < 2) return mean;
  std::vector<double> variances;
  variances.reserve(pixels.size());
  for (size_t i = 0; i + 1 < pixels.size(); ++i) {
    const PathStatistics& path = training_samples.paths[i];
    const double scale = tiles.inverse_scale(pixels[i]);
    const double d =
        double{training_samples.luminances[i]} - double{training_samples.luminances[i + 1]};
    const double v = ((spread ? 0 : 0.5 * d * d) + path.variance) * scale * scale;
    variances.push_back(std::isfinite(v) ? v : 0);
    mean.cost += path.cost / static_cast<double>(pixels.size() - 1);
    mean.vertices += path.vertices;
    mean.survivors += path.survivors;
  }
  mean.variance = trimmed_mean(variances, kTrimmedPaths) + spread.value_or(0);
  return mean;
}

double log_ratio_error(const PilotRender& a, const PilotRender& b, std::span<const uint32_t> pixels,
                       const ImageTiles& tiles) {
  const auto error_without = [&](const PilotRender& pilot, size_t group) {
    std::vector<uint32_t> kept;
    PilotRender part;
    for (size_t i = 0; i < pixels.size(); ++i) {
      if (i % kGroups == group) continue;
      kept.push_back(pixels[i]);
      part.differences.push_back(pilot.differences[i]);
    }
    return std::max(error_of(part, kept, tiles), 1e-30);
  };
  std::array<double, kGroups> logs{};
  for (size_t group = 0; group < kGroups; ++group)
    logs[group] = std::log(error_without(a, group) / error_without(b, group));
  const double mean = std::accumulate(logs.begin(), logs.end(), 0.0) / kGroups;
  double sum = 0;
  for (const double x : logs) sum += (x - mean) * (x - mean);
  return std::sqrt(sum * (kGroups - 1) / kGroups);
}

}  // namespace wavecomb
