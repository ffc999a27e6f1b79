// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/render/guide_training.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <optional>

#include "wavecomb/core/clock.h"
#include "wavecomb/learn/guide.h"
#include "wavecomb/render/bounce_reader.h"
#include "wavecomb/render/lane_kernels.h"
#include "wavecomb/render/pass_runner.h"
#include "wavecomb/render/picture_tiles.h"
#include "wavecomb/render/pixel_order.h"

namespace wavecomb {
namespace {

/// Share of a render's samples that training may take, and its most and least paths.
constexpr uint64_t kTrainingShare = 8, kMostTrainingPaths = 700'000, kLeastTrainingPaths = 16'384;
/// Of Guiding::kAuto, so that what it costs to find out is a twentieth of the render at most: a
/// path that teaches costs some three times one of the picture.
constexpr uint64_t kAutoShare = 100, kLeastAutoPaths = 200'000;
/// Paths that a thread teaches in a second, and the shares of a time limit that may go to them.
constexpr double kTaughtInSecond = 50'000, kTimeShare = 8, kAutoTimeShare = 20;
/// Of Guiding::kAuto: some pixels are rendered with and without the field, twice each with so many
/// samples, which Sobol's points and roulette are in as they are in the picture.
constexpr uint64_t kTrialPixels = 4096;
constexpr uint32_t kTrialSamples = 16;
constexpr std::array<uint32_t, 2> kTrialSeeds = {0x6c078965u, 0x9908b0dfu};
/// Share of the paths that teach, of more that tell how samples spread.
constexpr uint64_t kSpreadShare = 8;
/// Share of those pixels that differ most and do not count: fireflies tell too little of the
/// others.
constexpr double kUncounted = 0.005;
/// The same of paths that tell of the picture's variance.
constexpr double kUncountedPaths = 0.001;
/// Efficiency to the same without the field that is worth it.
constexpr double kWorthwhileGain = 1.2;
constexpr uint32_t kTrainingRounds = 3;
/// Paths whose vertices are kept at once: some 30 MB.
constexpr size_t kPathsAtOnce = 65'536;
/// Of the cost of a vertex, in rays: shading it, and looking up the field there. (Trials; what
/// materials cost, roulette knows by themselves.)
constexpr double kShadingRays = 0.7, kGuidedRays = 0.9;
/// What a ray costs where it is tested against a list, as a share of one in a hierarchy.
constexpr double kListRay = 0.3;

/// Paths that training may take; 0: too few to learn from.
uint64_t training_paths(const Settings& settings, uint32_t threads) {
  const bool is_auto = settings.guiding == Guiding::kAuto;
  const uint64_t samples = uint64_t{settings.width} * settings.height * settings.spp;
  uint64_t paths = std::min(samples / (is_auto ? kAutoShare : kTrainingShare), kMostTrainingPaths);
  // A limit of time is a render's only measure where it has more samples than it can take.
  if (settings.time_limit > 0) {
    const double taught = double{settings.time_limit} * threads * kTaughtInSecond /
                          (is_auto ? kAutoTimeShare : kTimeShare);
    paths = std::min(paths, static_cast<uint64_t>(std::min(taught, 1e9)));
  }
  return paths >= (is_auto ? kLeastAutoPaths : kLeastTrainingPaths) ? paths : 0;
}

/// `count` of the picture's pixels, evenly spread, in an order that keeps neighbours together.
std::vector<uint32_t> some_pixels(const std::vector<uint32_t>& order, uint64_t count) {
  if (count >= order.size()) return order;
  std::vector<uint32_t> pixels(count);
  for (uint64_t i = 0; i < count; ++i) pixels[i] = order[i * order.size() / count];
  return pixels;
}

/// The mean without the share of values that are largest. Sorts them.
double mean_without_largest(std::vector<double>& values, double share) {
  std::sort(values.begin(), values.end());
  const auto counted =
      static_cast<std::ptrdiff_t>(static_cast<double>(values.size()) * (1 - share));
  return std::accumulate(values.begin(), values.begin() + counted, 0.0) /
         static_cast<double>(std::max<std::ptrdiff_t>(counted, 1));
}

/// Cost of what an integrator has done, in rays of a hierarchy.
double cost_of(const Integrator& integrator, const TrainingMeans& means, bool has_list,
               bool looks_up) {
  double rays = 0, records = 0;
  for (uint32_t i = 0; i < means.threads; ++i)
    if (const Counts* c = integrator.worker(i).counts) {
      rays += static_cast<double>(c->rays + c->shadow_rays);
      records += static_cast<double>(c->records);
    }
  return (has_list ? kListRay : 1) * rays + (kShadingRays + (looks_up ? kGuidedRays : 0)) * records;
}

/// Cost and variance of a path: of those of the last round, which are of `pixels`, with what
/// roulette adds. `spread`: the variance without; where it is not known yet, neighbours tell. The
/// paths that differ most do not count, as in trials.
PathLesson mean_path(const Lessons& lessons, std::span<const uint32_t> pixels,
                     const PictureTiles& tiles, std::optional<double> spread) {
  PathLesson mean;
  if (!tiles.is_lit() || pixels.size() < 2) return mean;
  std::vector<double> variances;
  variances.reserve(pixels.size());
  for (size_t i = 0; i + 1 < pixels.size(); ++i) {
    const PathLesson& path = lessons.paths[i];
    const double scale = tiles.inverse_scale(pixels[i]);
    const double d = double{lessons.luminances[i]} - double{lessons.luminances[i + 1]};
    const double v = ((spread ? 0 : 0.5 * d * d) + path.variance) * scale * scale;
    variances.push_back(std::isfinite(v) ? v : 0);
    mean.cost += path.cost / static_cast<double>(pixels.size() - 1);
    mean.vertices += path.vertices;
    mean.survivors += path.survivors;
  }
  mean.variance = mean_without_largest(variances, kUncountedPaths) + spread.value_or(0);
  return mean;
}

/// Runs the paths of `pixels` that `plan` says with the field of `context`, some at a time, and
/// adds what they taught. Gives what they cost, in rays of a hierarchy.
double teach(WaveContext context, const TrainingMeans& means, std::span<const uint32_t> pixels,
             const LessonPlan& plan, Lessons& lessons, const std::function<bool()>& stopped) {
  // Integrators keep vertices where somebody reads them when they are made.
  BounceReader nobody({}, plan);
  context.histories = &nobody;
  const std::unique_ptr<Integrator> integrator = make_integrator(
      context.settings->integrator, context, means.lanes, means.threads, means.wave_size);
  PassRunner runner(*integrator, means.threads, means.wave_size);
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
  return cost_of(*integrator, means, context.accel->has_list(), context.guide != nullptr);
}

/// What pictures of some pixels are like.
struct Trial {
  double error = 0;  ///< mean squared difference of two, relative to the picture there
  double cost = 0;   ///< of both, in rays of a hierarchy
};

/// Renders kTrialSamples of each of `pixels` twice, as `settings` say but for the seed.
Trial try_out(WaveContext context, Settings settings, const GuideView* guide,
              const TrainingMeans& means, std::span<const uint32_t> pixels,
              const PictureTiles& tiles, const GuideGrid& grid,
              const std::function<bool()>& stopped) {
  Trial trial;
  std::vector<double> differences(pixels.size());
  context.settings = &settings;
  context.guide = guide;
  for (const uint32_t seed : kTrialSeeds) {
    settings.seed = seed;
    Lessons lessons;
    const LessonPlan plan{0, kTrialSamples, 0, grid, {}, nullptr, {}, 1};
    trial.cost += teach(context, means, pixels, plan, lessons, stopped);
    if (stopped()) return {};
    const double sign = seed == kTrialSeeds[0] ? 1 : -1;
    for (size_t i = 0; i < pixels.size(); ++i)
      for (uint32_t s = 0; s < kTrialSamples; ++s)
        differences[i] += sign * double{lessons.luminances[i * kTrialSamples + s]};
  }
  for (size_t i = 0; i < pixels.size(); ++i) {
    const double d = differences[i] * tiles.inverse_scale(pixels[i]) / kTrialSamples;
    differences[i] = std::isfinite(d) ? d * d : 0;
  }
  trial.error = mean_without_largest(differences, kUncounted);
  return trial;
}

}  // namespace

GuideView view_of(const GuideTraining& training) {
  GuideView view = training.field->view();
  if (training.tiles) training.tiles->apply(view);
  return view;
}

GuideGrid grid_of(const Scene& scene) {
  const Bounds& b = scene.bounds();
  return {{b.lo.x, b.lo.y, b.lo.z}, {b.hi.x, b.hi.y, b.hi.z}};
}

GuideTraining train_guide(const WaveContext& render, const Scene& scene, const TrainingMeans& means,
                          const std::function<bool()>& stopped) {
  const Clock::time_point start = Clock::now();
  GuideTraining out;
  Settings settings = *render.settings;
  const uint64_t budget = training_paths(settings, means.threads);
  const bool is_auto = settings.guiding == Guiding::kAuto;
  const bool guides = settings.guiding != Guiding::kOff;
  const bool learns = guides || settings.roulette == RouletteKind::kEfficient;
  if (!learns || settings.max_depth == 0 || budget == 0) return out;
  settings.region.reset();
  settings.crop = false;
  settings.aovs = {};
  const Settings trial_settings = settings;
  settings.seed = 0x2545f491u;
  // A survivor of roulette brings many times what it stands for: noise that hides what aiming wins.
  settings.roulette = RouletteKind::kOff;

  const AovTables aovs(scene, settings);
  Film film(1, 1, aovs.layout);
  WaveContext context = render;
  context.settings = &settings;
  context.film = &film;
  context.aovs = nullptr;
  context.recorder = nullptr;
  context.discards = true;
  const GuideGrid grid = grid_of(scene);
  auto field = std::make_unique<const GuideField>(grid);
  const std::vector<uint32_t> order = morton_pixel_order({0, 0, settings.width, settings.height});
  std::optional<PictureTiles> tiles;
  const CostSnapshot shading = model_costs(scene);
  const PathCosts costs{context.accel->has_list() ? kListRay : 1.0, guides ? kGuidedRays : 0,
                        &shading};
  Lessons lessons;
  uint32_t first_sample = 0;
  for (uint32_t round = 0; round < kTrainingRounds; ++round) {
    const uint64_t wanted = (budget << round) / ((1u << kTrainingRounds) - 1);
    const auto samples = static_cast<uint32_t>(std::max<uint64_t>(1, wanted / order.size()));
    const std::vector<uint32_t> pixels = some_pixels(order, wanted);
    const bool is_first = round == 0;
    GuideView view = field->view();
    if (tiles) tiles->apply(view);
    context.guide = &view;
    const LessonPlan plan{first_sample,
                          samples,
                          settings.max_depth,
                          grid,
                          view,
                          tiles ? &*tiles : nullptr,
                          costs,
                          settings.roulette_depth};
    teach(context, means, pixels, plan, lessons, stopped);
    if (stopped()) return {};
    first_sample += samples;
    out.statistics.paths += lessons.luminances.size();
    ++out.statistics.rounds;
    std::vector<uint32_t> of_paths;
    for (const uint32_t pixel : pixels) of_paths.insert(of_paths.end(), samples, pixel);
    if (!tiles) tiles.emplace(settings, of_paths, lessons.luminances);
    auto next =
        std::make_unique<GuideField>(grid, lessons.records, scene.materials().size(), is_first,
                                     guides, size_t{settings.learn_memory_mb} << 20);
    std::optional<double> spread;
    if (round + 1 == kTrainingRounds && tiles->is_lit()) {
      GuideView taught = next->view();
      tiles->apply(taught);
      const auto few = some_pixels(order, budget / kSpreadShare / (2 * kTrialSamples));
      spread = 0.5 * kTrialSamples *
               try_out(context, settings, &taught, means, few, *tiles, grid, stopped).error;
      if (stopped()) return {};
    }
    const PathLesson mean = mean_path(lessons, of_paths, *tiles, spread);
    if (mean.vertices > 0) out.statistics.survival = mean.survivors / mean.vertices;
    next->weigh_bounces(lessons.bounces, mean);
    field = std::move(next);
  }
  out.statistics.field_bytes = field->bytes();
  out.statistics.facts = field->facts();
  bool pays = field->facts().regions > 0;
  if (is_auto && pays && tiles->is_lit()) {
    const std::vector<uint32_t> pixels = some_pixels(order, kTrialPixels);
    GuideView view = field->view();
    tiles->apply(view);
    const auto trial = [&](const GuideView* guide) {
      return try_out(context, trial_settings, guide, means, pixels, *tiles, grid, stopped);
    };
    const Trial without = trial(nullptr), with = trial(&view);
    if (stopped()) return {};
    if (with.error * with.cost > 0)
      out.statistics.gain = without.error * without.cost / (with.error * with.cost);
    pays = out.statistics.gain >= kWorthwhileGain;
  }
  out.statistics.used = pays;
  if (pays) {
    out.field = std::move(field);
    out.tiles = std::move(tiles);
  }
  out.statistics.seconds = seconds_since(start);
  return out;
}

}  // namespace wavecomb
