// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/render/guide_training.h"

#include <algorithm>
#include <cmath>
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
/// Of Guiding::kAuto: the two rounds that decide, three sevenths of it, are to cost a twentieth of
/// the render, and a path of theirs costs some three times one of the picture's. Fewer paths would
/// decide wrongly (docs/guiding.md).
constexpr uint64_t kAutoShare = 30, kLeastAutoPaths = 500'000;
/// Paths that a thread teaches in a second of a render with a time limit: what a slow one does.
constexpr double kTaughtInSecond = 50'000;
constexpr uint32_t kTrainingRounds = 3;
/// Paths whose vertices are kept at once: some 20 MB.
constexpr size_t kPathsAtOnce = 65'536;
/// Vertices of a path that teach.
constexpr uint32_t kTaughtVertices = 6;
/// Of Guiding::kAuto: efficiency to rounds without a field that is worth it. Sobol's points, which
/// training has few of, make pictures better than its paths tell. Training ends as soon as the
/// gain is below that by kSureErrors standard errors.
constexpr double kWorthwhileGain = 1.15, kSureErrors = 2;
/// Of the cost of a vertex, in rays: shading it, and looking up the field there.
constexpr double kShadingRays = 0.7, kGuidedRays = 0.3;
/// What a ray costs where it is tested against a list, as a share of one in a hierarchy.
constexpr double kListRay = 0.3;

/// Paths that training may take; 0: too few to learn from.
uint64_t training_paths(const Settings& settings, uint32_t threads) {
  const bool is_auto = settings.guiding == Guiding::kAuto;
  const uint64_t samples = uint64_t{settings.width} * settings.height * settings.spp;
  uint64_t paths = std::min(samples / (is_auto ? kAutoShare : kTrainingShare), kMostTrainingPaths);
  // A limit of time is a render's only measure where it has more samples than it can take.
  if (settings.time_limit > 0) {
    const double taught = double{settings.time_limit} * threads * kTaughtInSecond / kTrainingShare;
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

/// What the paths of a round are worth: 1 / (variance x cost), both of a path in the mean.
struct Worth {
  double efficiency = 0;         ///< 0: not known
  double relative_variance = 0;  ///< of that figure
};

/// Luminances are those of `samples` paths of each pixel, `cost` is that of all.
Worth worth_of(const PictureTiles& tiles, std::span<const uint32_t> pixels, uint32_t samples,
               std::span<const float> luminances, double cost) {
  // Of the picture's brightness there: a firefly is no measure of the others.
  constexpr double kMost = 50;
  std::vector<double> sums(tiles.count()), counts(tiles.count());
  double squares = 0, fourths = 0;
  for (size_t i = 0; i < luminances.size(); ++i) {
    const uint32_t pixel = pixels[i / samples], tile = tiles.of(pixel);
    const double y = std::min(double{luminances[i]} * tiles.inverse_scale(pixel), kMost);
    counts[tile] += 1;
    if (!(y > 0)) continue;  // false for NaN
    squares += y * y;
    fourths += y * y * y * y;
    sums[tile] += y;
  }
  for (size_t t = 0; t < sums.size(); ++t)
    if (counts[t] > 0) squares -= sums[t] * sums[t] / counts[t];
  const auto paths = static_cast<double>(luminances.size());
  if (!(squares > 0 && cost > 0)) return {};
  return {paths * paths / (squares * cost), fourths / (squares * squares)};
}

/// What the paths of training have taught, path by path.
struct Lessons {
  std::vector<TrainingRecord> records;
  std::vector<uint64_t> dark;
  std::vector<float> luminances;  ///< of the paths of the last round
};

/// Runs `samples` paths of each of `pixels` from sample `first` on with the field of `context`,
/// some at a time, and adds what they taught.
void teach(WaveContext& context, Integrator& integrator, const TrainingMeans& means,
           std::span<const uint32_t> pixels, uint32_t first, uint32_t samples,
           const GuideGrid& grid, const PictureTiles* tiles, Lessons& lessons,
           const std::function<bool()>& stopped) {
  PassRunner runner(integrator, means.threads, means.wave_size);
  const size_t step = std::max<size_t>(1, kPathsAtOnce / samples);
  lessons.luminances.clear();
  for (size_t at = 0; at < pixels.size() && !stopped(); at += step) {
    const auto some = pixels.subspan(at, std::min(step, pixels.size() - at));
    PassPlan plan;
    plan.pixels.assign(some.begin(), some.end());
    plan.batches.push_back({0, plan.pixels.size(), first, samples});
    BounceReader reader(plan.pixels, first, samples, context.settings->max_depth, grid,
                        *context.guide, tiles);
    context.histories = &reader;
    runner.run(plan, stopped);
    reader.append_to(lessons.records, lessons.dark);
    const auto brought = reader.luminances();
    lessons.luminances.insert(lessons.luminances.end(), brought.begin(), brought.end());
  }
  context.histories = nullptr;
}

/// Cost of a round, in rays of a hierarchy.
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
  Worth alone;  ///< without a field
  for (uint32_t round = 0; round < kTrainingRounds; ++round) {
    const uint64_t wanted = (budget << round) / ((1u << kTrainingRounds) - 1);
    const auto samples = static_cast<uint32_t>(std::max<uint64_t>(1, wanted / order.size()));
    const std::vector<uint32_t> pixels = some_pixels(order, wanted);
    const bool is_first = round == 0;
    GuideView view = field->view();
    if (tiles) tiles->apply(view);
    context.guide = &view;
    const std::unique_ptr<Integrator> integrator =
        make_integrator(settings.integrator, context, means.lanes, means.threads, means.wave_size);
    teach(context, *integrator, means, pixels, first_sample, samples, grid,
          tiles ? &*tiles : nullptr, lessons, stopped);
    if (stopped()) return {};
    first_sample += samples;
    out.statistics.paths += lessons.luminances.size();
    ++out.statistics.rounds;
    if (!tiles) {
      std::vector<uint32_t> of_paths;
      for (const uint32_t pixel : pixels) of_paths.insert(of_paths.end(), samples, pixel);
      tiles.emplace(settings, of_paths, lessons.luminances);
    }
    if (tiles->is_lit()) {
      const Worth worth =
          worth_of(*tiles, pixels, samples, lessons.luminances,
                   cost_of(*integrator, means, context.accel->has_list(), !is_first));
      if (is_first) {
        alone = worth;
      } else if (alone.efficiency > 0) {
        out.statistics.gain = worth.efficiency / alone.efficiency;
        const double error = std::sqrt(worth.relative_variance + alone.relative_variance);
        if (is_auto && out.statistics.gain * (1 + kSureErrors * error) < kWorthwhileGain) break;
      }
    }
    auto next =
        std::make_unique<GuideField>(grid, lessons.records, scene.materials().size(), is_first,
                                     guides, size_t{settings.learn_memory_mb} << 20);
    next->count_dark(lessons.dark);
    field = std::move(next);
  }
  out.statistics.field_bytes = field->bytes();
  out.statistics.facts = field->facts();
  const bool pays = !is_auto || out.statistics.gain >= kWorthwhileGain;
  if (field->facts().regions > 0 && pays) {
    out.field = std::move(field);
    out.tiles = std::move(tiles);
    out.statistics.used = true;
  }
  out.statistics.seconds = seconds_since(start);
  return out;
}

}  // namespace wavecomb
