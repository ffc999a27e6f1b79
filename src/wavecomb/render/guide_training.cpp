// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/render/guide_training.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <optional>

#include "wavecomb/core/clock.h"
#include "wavecomb/learn/guide.h"
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
/// Share of those pixels that differ most and do not count: fireflies tell too little of the
/// others.
constexpr double kUncounted = 0.005;
/// Efficiency to the same without the field that is worth it.
constexpr double kWorthwhileGain = 1.2;
constexpr uint32_t kTrainingRounds = 3;
/// Paths whose vertices are kept at once: some 20 MB.
constexpr size_t kPathsAtOnce = 65'536;
/// Vertices of a path that teach.
constexpr uint32_t kTaughtVertices = 6;
/// Of the cost of a vertex, in rays: shading it, and looking up the field there.
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

/// Gathers what the bounces of a round teach, each path's in its own place.
class BounceReader final : public HistoryReader {
 public:
  /// Paths of `pixels`, `samples` each from sample `first` on. `scale`: of the picture at a pixel.
  BounceReader(std::span<const uint32_t> pixels, uint32_t first, uint32_t samples,
               uint32_t most_depth, const GuideGrid& grid, const GuideView& guide,
               const PictureTiles* tiles)
      : pixels_(pixels),
        first_(first),
        samples_(samples),
        most_depth_(most_depth),
        grid_(grid),
        guide_(guide),
        tiles_(tiles) {
    const size_t paths = pixels.size() * samples;
    records_.resize(paths * kTaughtVertices);
    dark_.resize(paths * kTaughtVertices);
    counts_.assign(paths, 0);
    dark_counts_.assign(paths, 0);
    luminance_.assign(paths, 0.f);
  }

  uint32_t most() const override { return kTaughtVertices; }

  void ended(const PathHistory& history, const float* radiance, const WaveTask& task) override {
    for (uint32_t slot = 0; slot < task.path_count(); ++slot) {
      const auto pixel = static_cast<size_t>(task.pixels - pixels_.data()) + slot / task.samples;
      const size_t path = pixel * samples_ + (task.first_sample - first_) + slot % task.samples;
      const Color<float> end = load_row<RadianceRow, float>(radiance, slot, true).sum;
      luminance_[path] = luminance(end);
      const float inverse_scale = tiles_ && tiles_->is_lit()
                                      ? static_cast<float>(tiles_->inverse_scale(pixels_[pixel]))
                                      : 1.f;
      Color<float> throughput(1.f);
      for (uint32_t j = 0; j < history.count(slot); ++j) {
        const HistoryRow<float> v = history.vertex(slot, j);
        const float arrived = luminance(throughput);
        const float brought = luminance(end - v.radiance);
        throughput = v.throughput;
        const float value = brought / arrived;
        if (j == most_depth_) break;  // which makes no bounce
        const bool is_dead = is_black(v.throughput);
        if (is_dead || (v.pdf > 0 && !(value > 0)))
          dark_[path * kTaughtVertices + dark_counts_[path]++] = dark_bounce(grid_, v.p, v.axis);
        else if (v.pdf > 0 && std::isfinite(value))
          add(path, v, value, arrived * inverse_scale);
      }
    }
  }

  /// Appends the records, path by path.
  void append_to(std::vector<TrainingRecord>& all, std::vector<uint64_t>& dark) const {
    for (size_t path = 0; path < counts_.size(); ++path) {
      const auto from = records_.begin() + static_cast<std::ptrdiff_t>(path * kTaughtVertices);
      all.insert(all.end(), from, from + counts_[path]);
      const auto first_dark = dark_.begin() + static_cast<std::ptrdiff_t>(path * kTaughtVertices);
      dark.insert(dark.end(), first_dark, first_dark + dark_counts_[path]);
    }
  }
  std::span<const float> luminances() const { return luminance_; }

 private:
  void add(size_t path, const HistoryRow<float>& v, float value, float weight) {
    TrainingRecord& r = records_[path * kTaughtVertices + counts_[path]++];
    const Vec2<float> at = octahedral_point<float>(v.wi);
    const auto bin = [](float x) {
      return std::min(static_cast<uint32_t>(x * kGuideSide), kGuideSide - 1);
    };
    r = {{v.p.x, v.p.y, v.p.z},
         v.material,
         static_cast<uint8_t>(v.axis),
         static_cast<uint8_t>(bin(at.y) * kGuideSide + bin(at.x)),
         value,
         v.pdf,
         v.bsdf_pdf,
         0.f,
         weight};
    const GuidePlace<float> place = find_guide<float>(guide_, v.p, v.axis, v.material, true);
    if (place.region != kNoGuideRegion) r.guide_pdf = guide_pdf<float>(guide_, place, v.wi, true);
  }

  std::span<const uint32_t> pixels_;
  uint32_t first_, samples_, most_depth_;
  const GuideGrid& grid_;
  const GuideView& guide_;
  const PictureTiles* tiles_;
  std::vector<TrainingRecord> records_;  ///< kTaughtVertices of each path
  std::vector<uint64_t> dark_;
  std::vector<uint8_t> counts_, dark_counts_;
  std::vector<float> luminance_;
};

/// `count` of the picture's pixels, evenly spread, in an order that keeps neighbours together.
std::vector<uint32_t> some_pixels(const std::vector<uint32_t>& order, uint64_t count) {
  if (count >= order.size()) return order;
  std::vector<uint32_t> pixels(count);
  for (uint64_t i = 0; i < count; ++i) pixels[i] = order[i * order.size() / count];
  return pixels;
}

/// What the paths of training have taught, path by path.
struct Lessons {
  std::vector<TrainingRecord> records;
  std::vector<uint64_t> dark;
  std::vector<float> luminances;  ///< of the paths of the last round
};

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

/// Runs `samples` paths of each of `pixels` from sample `first` on with the field of `context`,
/// some at a time, and adds what they taught. Gives what they cost, in rays of a hierarchy.
double teach(WaveContext context, const TrainingMeans& means, std::span<const uint32_t> pixels,
             uint32_t first, uint32_t samples, const GuideGrid& grid, const PictureTiles* tiles,
             Lessons& lessons, const std::function<bool()>& stopped) {
  const GuideView none;
  const auto reader_of = [&](std::span<const uint32_t> some) {
    return BounceReader(some, first, samples, context.settings->max_depth, grid,
                        context.guide ? *context.guide : none, tiles);
  };
  // Integrators keep vertices where somebody reads them when they are made.
  BounceReader nobody = reader_of({});
  context.histories = &nobody;
  const std::unique_ptr<Integrator> integrator = make_integrator(
      context.settings->integrator, context, means.lanes, means.threads, means.wave_size);
  PassRunner runner(*integrator, means.threads, means.wave_size);
  const size_t step = std::max<size_t>(1, kPathsAtOnce / samples);
  lessons.luminances.clear();
  for (size_t at = 0; at < pixels.size() && !stopped(); at += step) {
    const auto some = pixels.subspan(at, std::min(step, pixels.size() - at));
    PassPlan plan;
    plan.pixels.assign(some.begin(), some.end());
    plan.batches.push_back({0, plan.pixels.size(), first, samples});
    BounceReader reader = reader_of(plan.pixels);
    context.histories = &reader;
    runner.run(plan, stopped);
    reader.append_to(lessons.records, lessons.dark);
    const auto brought = reader.luminances();
    lessons.luminances.insert(lessons.luminances.end(), brought.begin(), brought.end());
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
    trial.cost += teach(context, means, pixels, 0, kTrialSamples, grid, nullptr, lessons, stopped);
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
  std::sort(differences.begin(), differences.end());
  const auto counted =
      static_cast<std::ptrdiff_t>(static_cast<double>(differences.size()) * (1 - kUncounted));
  trial.error = std::accumulate(differences.begin(), differences.begin() + counted, 0.0) /
                static_cast<double>(std::max<std::ptrdiff_t>(counted, 1));
  return trial;
}

}  // namespace

GuideView view_of(const GuideTraining& training) {
  GuideView view = training.field->view();
  if (training.tiles) training.tiles->apply(view);
  return view;
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
  const Bounds& b = scene.bounds();
  const GuideGrid grid({b.lo.x, b.lo.y, b.lo.z}, {b.hi.x, b.hi.y, b.hi.z});
  auto field = std::make_unique<const GuideField>(grid);
  const std::vector<uint32_t> order = morton_pixel_order({0, 0, settings.width, settings.height});
  std::optional<PictureTiles> tiles;
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
    teach(context, means, pixels, first_sample, samples, grid, tiles ? &*tiles : nullptr, lessons,
          stopped);
    if (stopped()) return {};
    first_sample += samples;
    out.statistics.paths += lessons.luminances.size();
    ++out.statistics.rounds;
    if (!tiles) {
      std::vector<uint32_t> of_paths;
      for (const uint32_t pixel : pixels) of_paths.insert(of_paths.end(), samples, pixel);
      tiles.emplace(settings, of_paths, lessons.luminances);
    }
    auto next =
        std::make_unique<GuideField>(grid, lessons.records, scene.materials().size(), is_first,
                                     guides, size_t{settings.learn_memory_mb} << 20);
    next->count_dark(lessons.dark);
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
