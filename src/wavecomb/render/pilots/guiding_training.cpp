// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/render/pilots/guiding_training.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <utility>

#include "wavecomb/core/clock.h"
#include "wavecomb/guiding/bounce/bounce_reader.h"
#include "wavecomb/render/passes/pixel_order.h"
#include "wavecomb/render/pilots/guiding_pilot.h"
#include "wavecomb/wave/wave.h"

namespace wavecomb {
namespace {

/// Training takes one path for every kTrainingShare samples of the render, within these limits.
constexpr uint64_t kTrainingShare = 8, kMostTrainingPaths = 700'000, kLeastTrainingPaths = 16'384;
/// The same for Guiding::kAuto, which does not train with fewer paths.
constexpr uint64_t kAutoShare = 100, kLeastAutoPaths = 200'000;
/// Least number of training paths for Guiding::kAuto if cost limits them.
constexpr uint64_t kFewestAutoPaths = 120'000;
/// Training paths per thread and second, assumed before the first round is timed, and the divisors
/// of a time limit that give the time for training (the second for Guiding::kAuto).
constexpr double kTaughtInSecond = 50'000, kTimeShare = 8, kAutoTimeShare = 25;
/// For Guiding::kAuto: divisors of the time limit after which training gives up, at first and once
/// guiding is known to reduce noise.
constexpr double kMostTimeShare = 20, kMostPaidTimeShare = 4;
/// For Guiding::kAuto: largest cost of training as a fraction of the cost of the render, and the
/// cost of recording and sorting the vertices of a training path, as a factor on its rays and
/// shading.
constexpr double kAutoCostShare = 0.05, kTeachingCost = 1.5;
/// Paths in each image of a pilot render, and limits of its samples per pixel. It renders fewer
/// pixels rather than fewer samples, because the noise of Sobol samples falls with their number the
/// faster the smoother a pixel is, and guiding makes the integrand less smooth.
constexpr uint64_t kTrialPaths = 65'536;
constexpr uint32_t kLeastTrialSamples = 16, kMostTrialSamples = 32;
/// Samples per pixel from which the variance is estimated for learned roulette.
constexpr uint32_t kSpreadSamples = 16;
/// One such sample for every kSpreadShare training paths.
constexpr uint64_t kSpreadShare = 8;
/// Fraction of paths with the largest differences that are left out of the variance.
constexpr double kUncountedPaths = 0.001;
/// Least measured gain in efficiency for which the render is guided, and for which training
/// continues after its first half. The first is well above 1, because pilot renders scatter and
/// overestimate the gain of longer renders.
constexpr double kWorthwhileGain = 1.5, kPromisingGain = 1.2;
constexpr uint32_t kTrainingRounds = 3;
/// Round after which the gain is measured, at about half of the training.
constexpr uint32_t kHalfway = 1;

/// Converts to a number of paths, at most kMostTrainingPaths.
uint64_t as_count(double paths) {
  return static_cast<uint64_t>(std::min(paths, static_cast<double>(kMostTrainingPaths)));
}

/// Returns one path for every `share` samples of the render, at most kMostTrainingPaths.
uint64_t share_of_samples(const Settings& settings, uint64_t share) {
  const uint64_t samples = uint64_t{settings.width} * settings.height * settings.spp;
  return std::min(samples / share, kMostTrainingPaths);
}

/// Returns the number of training paths, or 0 if they are too few to learn from.
uint64_t training_paths(const Settings& settings, uint32_t threads) {
  const bool is_auto = settings.guiding == Guiding::kAuto;
  uint64_t paths = share_of_samples(settings, is_auto ? kAutoShare : kTrainingShare);
  // With a time limit, the sample count may be out of reach, so time bounds the training.
  if (settings.time_limit > 0) {
    const double taught = double{settings.time_limit} * threads * kTaughtInSecond /
                          (is_auto ? kAutoTimeShare : kTimeShare);
    paths = std::min(paths, as_count(taught));
  }
  return paths >= (is_auto ? kLeastAutoPaths : kLeastTrainingPaths) ? paths : 0;
}

/// Returns the mean cost and variance of a path, from the paths of the last round, which belong to
/// `pixels`, with the effect of roulette. `spread` is the variance without roulette. If it is
/// unknown, it is estimated from differences between neighbours. Leaves out the paths that differ
/// most.
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

/// One training with all its rounds. For Guiding::kAuto it also decides whether to continue and
/// whether the render uses the field.
class Trainer {
 public:
  Trainer(const WaveContext& render, const Scene& scene, const WaveSetup& waves, uint64_t budget,
          const std::function<bool()>& stopped)
      : trial_settings_(whole_picture(*render.settings)),
        settings_(trial_settings_),
        waves_(waves),
        scene_(scene),
        budget_(budget),
        stopped_(stopped),
        aovs_(scene, trial_settings_),
        film_(1, 1, aovs_.layout),
        context_(render),
        shading_(model_costs(scene)),
        costs_{context_.accel->has_list() ? kListRay : 1.0, guides() ? kGuidedRays : 0, &shading_},
        grid_(grid_of(scene)),
        order_(morton_pixel_order({0, 0, settings_.width, settings_.height})),
        trial_samples_(std::clamp(settings_.spp, kLeastTrialSamples, kMostTrialSamples)),
        trial_pixels_(some_pixels(order_, kTrialPaths / trial_samples_)),
        field_(std::make_shared<const GuideField>(grid_)) {
    settings_.seed = 0x2545f491u;
    // Roulette multiplies the contribution of survivors, and this noise would hide the gain of
    // guiding.
    settings_.roulette = RouletteKind::kOff;
    if (is_auto() && is_timed()) most_s_ = double{settings_.time_limit} / kMostTimeShare;
    context_.settings = &settings_;
    context_.film = &film_;
    context_.aovs = nullptr;
    context_.recorder = nullptr;
    context_.discards = true;
  }

  GuideTraining train() {
    Trial without;
    if (is_auto()) without = trial(nullptr);
    for (uint32_t round = 0; round < kTrainingRounds && !ended(); ++round) {
      const double cost = run(round);
      if (ended()) break;
      if (!is_auto() && is_timed()) budget_ = most_paths();
      if (is_auto() && !goes_on(round, cost, without)) return result(false);
    }
    if (ended()) return result(false);
    bool pays = field_->facts().regions > 0;
    if (is_auto() && pays) pays = tell_gain(without) >= kWorthwhileGain;
    return result(pays && !ended());
  }

 private:
  /// Returns the settings of the whole image, without region, crop and AOVs.
  static Settings whole_picture(Settings settings) {
    settings.region.reset();
    settings.crop = false;
    settings.aovs = {};
    return settings;
  }
  bool is_auto() const { return trial_settings_.guiding == Guiding::kAuto; }
  bool is_timed() const { return settings_.time_limit > 0; }
  bool guides() const { return trial_settings_.guiding != Guiding::kOff; }
  /// Returns whether the render was stopped or training has used up its time.
  bool ended() const { return stopped_() || seconds_since(start_) > most_s_; }

  GuideTraining result(bool used) {
    GuideTraining out;
    if (stopped_()) return out;
    out.statistics = statistics_;
    out.statistics.field_bytes = field_->bytes();
    out.statistics.facts = field_->facts();
    out.statistics.used = used;
    out.statistics.seconds = seconds_since(start_);
    if (!used) return out;
    out.field = std::move(field_);
    out.tiles = std::move(tiles_);
    return out;
  }

  Trial trial(const GuideView* guide) const {
    return try_out(
        context_, trial_settings_, waves_,
        {.pixels = trial_pixels_, .samples = trial_samples_, .guide = guide, .grid = grid_},
        [this] { return ended(); });
  }

  GuideView view() const {
    GuideView view = field_->view();
    if (tiles_) tiles_->apply(view);
    return view;
  }

  /// Returns the gain in efficiency of the current field, measured by a pilot render, or 0 if
  /// unknown.
  double tell_gain(const Trial& without) {
    if (!tiles_->is_lit() || field_->facts().regions == 0) return 0;
    const GuideView guide = view();
    const Trial with = trial(&guide);
    const double spent = error_of(with, trial_pixels_, *tiles_) * with.cost;
    if (spent > 0 && !ended())
      statistics_.gain = error_of(without, trial_pixels_, *tiles_) * without.cost / spent;
    return statistics_.gain;
  }

  /// For Guiding::kAuto, returns whether to continue after `round`, whose paths had the cost
  /// `cost`. Updates the budget.
  bool goes_on(uint32_t round, double cost, const Trial& without) {
    if (round == 0) return can_afford(cost, without);
    if (round != kHalfway) return true;
    const double gain = tell_gain(without);
    if (gain >= kWorthwhileGain) {
      // The render will be guided, so more training pays through a better field.
      budget_ = std::max(budget_, most_paths());
      if (is_timed()) most_s_ = double{settings_.time_limit} / kMostPaidTimeShare;
    }
    return gain >= kPromisingGain;
  }

  /// Lowers the budget to what the cost of the image allows. `cost` is the cost of the first
  /// round's paths. Returns false if too few paths are left.
  bool can_afford(double cost, const Trial& without) {
    if (is_timed()) return true;
    const auto samples = static_cast<double>(settings_.spp * uint64_t{order_.size()});
    const double picture = samples * without.cost_of_sample();
    const double path = kTeachingCost * cost / static_cast<double>(statistics_.paths);
    if (!(path > 0)) return true;
    picture_paths_ = picture / path;
    budget_ = std::min(budget_, as_count(kAutoCostShare * picture_paths_));
    return budget_ >= kFewestAutoPaths;
  }

  /// Returns the most training paths for a render that will be guided, from the speed so far.
  uint64_t most_paths() const {
    const uint64_t most = share_of_samples(settings_, kTrainingShare);
    if (!is_timed()) return std::min(most, as_count(picture_paths_ / kTrainingShare));
    const auto taught = static_cast<double>(statistics_.paths);
    const double left = double{settings_.time_limit} / kTimeShare - seconds_since(start_);
    return std::min(most, as_count(taught * (1 + std::max(0.0, left) / taught_s_)));
  }

  /// Traces the paths of a round and builds the field from all training samples so far. Returns the
  /// cost of the paths.
  double run(uint32_t round) {
    const uint64_t wanted = (budget_ << round) / ((1u << kTrainingRounds) - 1);
    const auto samples = static_cast<uint32_t>(std::max<uint64_t>(1, wanted / order_.size()));
    const std::vector<uint32_t> pixels = some_pixels(order_, wanted);
    const GuideView guide = view();
    const Clock::time_point begin = Clock::now();
    context_.guide = &guide;
    const LessonPlan plan{first_sample_,
                          samples,
                          settings_.max_depth,
                          grid_,
                          guide,
                          tiles_ ? &*tiles_ : nullptr,
                          costs_,
                          settings_.roulette_depth};
    const double cost = teach(context_, waves_, pixels, plan, lessons_, [this] { return ended(); });
    if (ended()) return cost;
    first_sample_ += samples;
    statistics_.paths += lessons_.luminances.size();
    ++statistics_.rounds;
    std::vector<uint32_t> of_paths;
    for (const uint32_t pixel : pixels) of_paths.insert(of_paths.end(), samples, pixel);
    if (!tiles_) tiles_.emplace(settings_, of_paths, lessons_.luminances);
    auto next =
        std::make_shared<GuideField>(grid_, lessons_.records, scene_.materials().size(), round == 0,
                                     guides(), size_t{settings_.learn_memory_mb} << 20);
    std::optional<double> spread;
    if (round + 1 == kTrainingRounds && tiles_->is_lit()) spread = spread_with(*next);
    if (ended()) return cost;
    const PathLesson mean = mean_path(lessons_, of_paths, *tiles_, spread);
    if (mean.vertices > 0) statistics_.survival = mean.survivors / mean.vertices;
    next->weigh_bounces(lessons_.bounces, mean);
    field_ = std::move(next);
    taught_s_ += seconds_since(begin);
    return cost;
  }

  /// Returns the variance of a path guided by `field`, for samples distributed as in the image.
  double spread_with(const GuideField& field) const {
    GuideView taught = field.view();
    tiles_->apply(taught);
    const auto few = some_pixels(order_, budget_ / kSpreadShare / (2 * kSpreadSamples));
    const Trial trial =
        try_out(context_, settings_, waves_,
                {.pixels = few, .samples = kSpreadSamples, .guide = &taught, .grid = grid_},
                [this] { return ended(); });
    return 0.5 * kSpreadSamples * error_of(trial, few, *tiles_);
  }

  const Clock::time_point start_ = Clock::now();
  const Settings trial_settings_;  ///< of the whole image
  Settings settings_;              ///< of the training paths
  const WaveSetup waves_;
  const Scene& scene_;
  uint64_t budget_;
  const std::function<bool()>& stopped_;
  const AovTables aovs_;
  Film film_;
  WaveContext context_;
  const CostSnapshot shading_;
  const PathCosts costs_;
  const GuideGrid grid_;
  const std::vector<uint32_t> order_;
  const uint32_t trial_samples_;
  const std::vector<uint32_t> trial_pixels_;
  double most_s_ = std::numeric_limits<double>::infinity();
  double taught_s_ = 0;  ///< time of the rounds, without pilot renders
  /// Number of training paths that cost as much as the image, if known.
  double picture_paths_ = std::numeric_limits<double>::infinity();
  Lessons lessons_;
  uint32_t first_sample_ = 0;
  std::optional<PictureTiles> tiles_;
  std::shared_ptr<const GuideField> field_;
  GuideStatistics statistics_;
};

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

bool is_taught(const Settings& settings) {
  return settings.guiding != Guiding::kOff || settings.roulette == RouletteKind::kEfficient;
}

GuideTraining train_guide(const WaveContext& render, const Scene& scene, const WaveSetup& waves,
                          const std::function<bool()>& stopped) {
  const Settings& settings = *render.settings;
  const uint64_t budget = training_paths(settings, waves.threads);
  if (!is_taught(settings) || settings.max_depth == 0 || budget == 0) return {};
  return Trainer(render, scene, waves, budget, stopped).train();
}

}  // namespace wavecomb
