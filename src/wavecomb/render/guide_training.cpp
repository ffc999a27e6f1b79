// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/render/guide_training.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <utility>

#include "wavecomb/core/clock.h"
#include "wavecomb/integrate/wave.h"
#include "wavecomb/render/bounce_reader.h"
#include "wavecomb/render/guide_trial.h"
#include "wavecomb/render/pixel_order.h"

namespace wavecomb {
namespace {

/// Share of a render's samples that training may take, and its most and least paths.
constexpr uint64_t kTrainingShare = 8, kMostTrainingPaths = 700'000, kLeastTrainingPaths = 16'384;
/// Of Guiding::kAuto.
constexpr uint64_t kAutoShare = 100, kLeastAutoPaths = 200'000;
/// Paths without which that is not worth it, where their cost leaves fewer.
constexpr uint64_t kFewestAutoPaths = 120'000;
/// Paths that a thread teaches in a second, until the first round tells, and the shares of a time
/// limit that may go to them.
constexpr double kTaughtInSecond = 50'000, kTimeShare = 8, kAutoTimeShare = 25;
/// Of Guiding::kAuto: the share of a time limit after which it gives up, and that where it is
/// known to pay.
constexpr double kMostTimeShare = 20, kMostPaidTimeShare = 4;
/// Of Guiding::kAuto: what training may cost, as a share of the picture, where it is counted; and
/// what a path that teaches costs beside its rays and vertices, which are kept, read and sorted.
constexpr double kAutoCostShare = 0.05, kTeachingCost = 1.5;
/// Samples of a trial, twice, and those of a pixel: as many as the picture has, of some. (Sobol's
/// points gain by their number, and by what a pixel is smooth, which guiding makes less of.)
constexpr uint64_t kTrialPaths = 65'536;
constexpr uint32_t kLeastTrialSamples = 16, kMostTrialSamples = 32;
/// Samples of a pixel that tell how they spread, for a roulette.
constexpr uint32_t kSpreadSamples = 16;
/// Share of the paths that teach, of more that tell how samples spread.
constexpr uint64_t kSpreadShare = 8;
/// Share of the paths that differ most and do not count for the picture's variance.
constexpr double kUncountedPaths = 0.001;
/// Efficiency to the same without the field that is worth it, for trials scatter, and promise more
/// than longer renders keep; and that which half of the training has to promise, so that the other
/// half follows.
constexpr double kWorthwhileGain = 1.5, kPromisingGain = 1.2;
constexpr uint32_t kTrainingRounds = 3;
/// The round after which half of the training has been.
constexpr uint32_t kHalfway = 1;

/// A number of paths, at most as many as are ever taken.
uint64_t as_count(double paths) {
  return static_cast<uint64_t>(std::min(paths, static_cast<double>(kMostTrainingPaths)));
}

/// Paths that are a share of a render's samples.
uint64_t share_of_samples(const Settings& settings, uint64_t share) {
  const uint64_t samples = uint64_t{settings.width} * settings.height * settings.spp;
  return std::min(samples / share, kMostTrainingPaths);
}

/// Paths that training may take; 0: too few to learn from.
uint64_t training_paths(const Settings& settings, uint32_t threads) {
  const bool is_auto = settings.guiding == Guiding::kAuto;
  uint64_t paths = share_of_samples(settings, is_auto ? kAutoShare : kTrainingShare);
  // A limit of time is a render's only measure where it has more samples than it can take.
  if (settings.time_limit > 0) {
    const double taught = double{settings.time_limit} * threads * kTaughtInSecond /
                          (is_auto ? kAutoTimeShare : kTimeShare);
    paths = std::min(paths, as_count(taught));
  }
  return paths >= (is_auto ? kLeastAutoPaths : kLeastTrainingPaths) ? paths : 0;
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

/// One training: its rounds, and for Guiding::kAuto whether they pay.
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
    // A survivor of roulette brings many times what it stands for: noise that hides what aiming
    // wins.
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
  /// The settings without what makes a render one of a part.
  static Settings whole_picture(Settings settings) {
    settings.region.reset();
    settings.crop = false;
    settings.aovs = {};
    return settings;
  }
  bool is_auto() const { return trial_settings_.guiding == Guiding::kAuto; }
  bool is_timed() const { return settings_.time_limit > 0; }
  bool guides() const { return trial_settings_.guiding != Guiding::kOff; }
  /// Whether the render was stopped, or training takes too much of its time.
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
    return try_out(context_, trial_settings_, guide, waves_, trial_pixels_, trial_samples_, grid_,
                   [this] { return ended(); });
  }

  GuideView view() const {
    GuideView view = field_->view();
    if (tiles_) tiles_->apply(view);
    return view;
  }

  /// What the field there is brings, as trials tell it; 0 where they cannot.
  double tell_gain(const Trial& without) {
    if (!tiles_->is_lit() || field_->facts().regions == 0) return 0;
    const GuideView guide = view();
    const Trial with = trial(&guide);
    const double spent = error_of(with, trial_pixels_, *tiles_) * with.cost;
    if (spent > 0 && !ended())
      statistics_.gain = error_of(without, trial_pixels_, *tiles_) * without.cost / spent;
    return statistics_.gain;
  }

  /// Of Guiding::kAuto: whether the rounds after `round`, which has cost `cost`, are worth it. Sets
  /// what they may take.
  bool goes_on(uint32_t round, double cost, const Trial& without) {
    if (round == 0) return can_afford(cost, without);
    if (round != kHalfway) return true;
    const double gain = tell_gain(without);
    if (gain >= kWorthwhileGain) {
      // It is guided then: what more paths cost, a better field brings back.
      budget_ = std::max(budget_, most_paths());
      if (is_timed()) most_s_ = double{settings_.time_limit} / kMostPaidTimeShare;
    }
    return gain >= kPromisingGain;
  }

  /// Lowers the budget to what the picture's cost allows. `cost`: of the first round's paths.
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

  /// Paths that training may take altogether where it pays, by what they have taken so far.
  uint64_t most_paths() const {
    const uint64_t most = share_of_samples(settings_, kTrainingShare);
    if (!is_timed()) return std::min(most, as_count(picture_paths_ / kTrainingShare));
    const auto taught = static_cast<double>(statistics_.paths);
    const double left = double{settings_.time_limit} / kTimeShare - seconds_since(start_);
    return std::min(most, as_count(taught * (1 + std::max(0.0, left) / taught_s_)));
  }

  /// Teaches by the paths of a round, and makes the field of what was taught so far. Gives what
  /// the paths cost.
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

  /// The variance of a path by a field, of paths that are as well spread as the picture's.
  double spread_with(const GuideField& field) const {
    GuideView taught = field.view();
    tiles_->apply(taught);
    const auto few = some_pixels(order_, budget_ / kSpreadShare / (2 * kSpreadSamples));
    const Trial trial = try_out(context_, settings_, &taught, waves_, few, kSpreadSamples, grid_,
                                [this] { return ended(); });
    return 0.5 * kSpreadSamples * error_of(trial, few, *tiles_);
  }

  const Clock::time_point start_ = Clock::now();
  const Settings trial_settings_;  ///< as the picture is
  Settings settings_;              ///< as paths that teach are
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
  double taught_s_ = 0;  ///< of the rounds, trials aside
  /// Paths that would cost what the picture does, where that is counted.
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
