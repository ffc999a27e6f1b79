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
constexpr uint64_t kTrainingShare = 8, kMaxTrainingPaths = 700'000, kMinTrainingPaths = 16'384;
/// The same for Guiding::kAuto, which does not train with fewer paths.
constexpr uint64_t kAutoShare = 100, kMinAutoPaths = 200'000;
/// Least number of training paths for Guiding::kAuto if cost limits them.
constexpr uint64_t kMinAffordablePaths = 120'000;
/// Training paths per thread and second, assumed before the first round is timed, and the divisors
/// of a time limit that give the time for training (the second for Guiding::kAuto).
constexpr double kTrainingPathsPerSecond = 50'000, kTimeShare = 8, kAutoTimeShare = 25;
/// For Guiding::kAuto: divisors of the time limit after which training gives up, at first and once
/// guiding is known to reduce noise.
constexpr double kMaxTimeShare = 20, kMaxGuidedTimeShare = 4;
/// For Guiding::kAuto: largest cost of training as a fraction of the cost of the render, and the
/// cost of recording and sorting the vertices of a training path, as a factor on its rays and
/// shading.
constexpr double kAutoCostShare = 0.05, kRecordingCost = 1.5;
/// Paths in each image of a pilot render, and limits of its samples per pixel. It renders fewer
/// pixels rather than fewer samples, because the noise of Sobol samples falls with their number the
/// faster the smoother a pixel is, and guiding makes the integrand less smooth.
constexpr uint64_t kPilotPaths = 65'536;
constexpr uint32_t kMinPilotSamples = 16, kMaxPilotSamples = 32;
/// Samples per pixel from which the variance is estimated for learned roulette.
constexpr uint32_t kSpreadSamples = 16;
/// One such sample for every kSpreadShare training paths.
constexpr uint64_t kSpreadShare = 8;
/// Fraction of paths with the largest differences that are left out of the variance.
constexpr double kTrimmedPaths = 0.001;
/// Least measured gain in efficiency for which the render is guided, and for which training
/// continues after its first half. The first is well above 1, because pilot renders scatter and
/// overestimate the gain of longer renders.
constexpr double kMinGain = 1.5, kMinHalfwayGain = 1.2;
constexpr uint32_t kTrainingRounds = 3;
/// Round after which the gain is measured, at about half of the training.
constexpr uint32_t kHalfway = 1;

/// Converts to a number of paths, at most kMaxTrainingPaths.
uint64_t as_count(double paths) {
  return static_cast<uint64_t>(std::min(paths, static_cast<double>(kMaxTrainingPaths)));
}

/// Returns one path for every `share` samples of the render, at most kMaxTrainingPaths.
uint64_t share_of_samples(const Settings& settings, uint64_t share) {
  const uint64_t samples = uint64_t{settings.width} * settings.height * settings.spp;
  return std::min(samples / share, kMaxTrainingPaths);
}

/// Returns the number of training paths, or 0 if they are too few to learn from.
uint64_t training_paths(const Settings& settings, uint32_t threads) {
  const bool is_auto = settings.guiding == Guiding::kAuto;
  uint64_t paths = share_of_samples(settings, is_auto ? kAutoShare : kTrainingShare);
  // With a time limit, the sample count may be out of reach, so time bounds the training.
  if (settings.time_limit > 0) {
    const double trained = double{settings.time_limit} * threads * kTrainingPathsPerSecond /
                           (is_auto ? kAutoTimeShare : kTimeShare);
    paths = std::min(paths, as_count(trained));
  }
  return paths >= (is_auto ? kMinAutoPaths : kMinTrainingPaths) ? paths : 0;
}

/// Returns the mean cost and variance of a path, from the paths of the last round, which belong to
/// `pixels`, with the effect of roulette. `spread` is the variance without roulette. If it is
/// unknown, it is estimated from differences between neighbours. Leaves out the paths that differ
/// most.
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

/// One training with all its rounds. For Guiding::kAuto it also decides whether to continue and
/// whether the render uses the field.
class Trainer {
 public:
  Trainer(const WaveContext& render, const Scene& scene, const WaveSetup& waves, uint64_t budget,
          const std::function<bool()>& stopped)
      : pilot_settings_(whole_image(*render.settings)),
        settings_(pilot_settings_),
        waves_(waves),
        scene_(scene),
        budget_(budget),
        stopped_(stopped),
        aovs_(scene, pilot_settings_),
        film_(1, 1, aovs_.layout),
        context_(render),
        shading_(model_costs(scene)),
        costs_{context_.accel->has_list() ? kListRay : 1.0, guides() ? kGuidedRays : 0, &shading_},
        grid_(grid_of(scene)),
        order_(morton_pixel_order({0, 0, settings_.width, settings_.height})),
        pilot_samples_(std::clamp(settings_.spp, kMinPilotSamples, kMaxPilotSamples)),
        pilot_pixels_(subset_of_pixels(order_, kPilotPaths / pilot_samples_)),
        field_(std::make_shared<const GuidingField>(grid_)) {
    settings_.seed = 0x2545f491u;
    // Roulette multiplies the contribution of survivors, and this noise would hide the gain of
    // guiding.
    settings_.roulette = RouletteKind::kOff;
    if (is_auto() && is_timed()) max_s_ = double{settings_.time_limit} / kMaxTimeShare;
    context_.settings = &settings_;
    context_.film = &film_;
    context_.aovs = nullptr;
    context_.recorder = nullptr;
    context_.discards = true;
  }

  GuidingTraining train() {
    PilotRender without;
    if (is_auto()) without = pilot(nullptr);
    for (uint32_t round = 0; round < kTrainingRounds && !ended(); ++round) {
      const double cost = run(round);
      if (ended()) break;
      if (!is_auto() && is_timed()) budget_ = max_paths();
      if (is_auto() && !should_continue(round, cost, without)) return result(false);
    }
    if (ended()) return result(false);
    bool reduces_noise = field_->facts().regions > 0;
    if (is_auto() && reduces_noise) reduces_noise = measure_gain(without) >= kMinGain;
    return result(reduces_noise && !ended());
  }

 private:
  /// Returns the settings of the whole image, without region, crop and AOVs.
  static Settings whole_image(Settings settings) {
    settings.region.reset();
    settings.crop = false;
    settings.aovs = {};
    return settings;
  }
  bool is_auto() const { return pilot_settings_.guiding == Guiding::kAuto; }
  bool is_timed() const { return settings_.time_limit > 0; }
  bool guides() const { return pilot_settings_.guiding != Guiding::kOff; }
  /// Returns whether the render was stopped or training has used up its time.
  bool ended() const { return stopped_() || seconds_since(start_) > max_s_; }

  GuidingTraining result(bool used) {
    GuidingTraining out;
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

  PilotRender pilot(const GuidingView* guide) const {
    return render_pilot(
        context_, pilot_settings_, waves_,
        {.pixels = pilot_pixels_, .samples = pilot_samples_, .guide = guide, .grid = grid_},
        [this] { return ended(); });
  }

  GuidingView view() const {
    GuidingView view = field_->view();
    if (tiles_) tiles_->apply(view);
    return view;
  }

  /// Returns the gain in efficiency of the current field, measured by a pilot render, or 0 if
  /// unknown.
  double measure_gain(const PilotRender& without) {
    if (!tiles_->is_lit() || field_->facts().regions == 0) return 0;
    const GuidingView guide = view();
    const PilotRender with = pilot(&guide);
    const double guided_cost = error_of(with, pilot_pixels_, *tiles_) * with.cost;
    if (guided_cost > 0 && !ended())
      statistics_.gain = error_of(without, pilot_pixels_, *tiles_) * without.cost / guided_cost;
    return statistics_.gain;
  }

  /// For Guiding::kAuto, returns whether to continue after `round`, whose paths had the cost
  /// `cost`. Updates the budget.
  bool should_continue(uint32_t round, double cost, const PilotRender& without) {
    if (round == 0) return limit_budget(cost, without);
    if (round != kHalfway) return true;
    const double gain = measure_gain(without);
    if (gain >= kMinGain) {
      // The render will be guided, so more training pays through a better field.
      budget_ = std::max(budget_, max_paths());
      if (is_timed()) max_s_ = double{settings_.time_limit} / kMaxGuidedTimeShare;
    }
    return gain >= kMinHalfwayGain;
  }

  /// Lowers the budget to what the cost of the image allows. `cost` is the cost of the first
  /// round's paths. Returns false if too few paths are left.
  bool limit_budget(double cost, const PilotRender& without) {
    if (is_timed()) return true;
    const auto samples = static_cast<double>(settings_.spp * uint64_t{order_.size()});
    const double image_cost = samples * without.cost_of_sample();
    const double path = kRecordingCost * cost / static_cast<double>(statistics_.paths);
    if (!(path > 0)) return true;
    image_paths_ = image_cost / path;
    budget_ = std::min(budget_, as_count(kAutoCostShare * image_paths_));
    return budget_ >= kMinAffordablePaths;
  }

  /// Returns the most training paths for a render that will be guided, from the speed so far.
  uint64_t max_paths() const {
    const uint64_t most = share_of_samples(settings_, kTrainingShare);
    if (!is_timed()) return std::min(most, as_count(image_paths_ / kTrainingShare));
    const auto trained = static_cast<double>(statistics_.paths);
    const double left = double{settings_.time_limit} / kTimeShare - seconds_since(start_);
    return std::min(most, as_count(trained * (1 + std::max(0.0, left) / training_s_)));
  }

  /// Traces the paths of a round and builds the field from all training samples so far. Returns the
  /// cost of the paths.
  double run(uint32_t round) {
    const uint64_t wanted = (budget_ << round) / ((1u << kTrainingRounds) - 1);
    const auto samples = static_cast<uint32_t>(std::max<uint64_t>(1, wanted / order_.size()));
    const std::vector<uint32_t> pixels = subset_of_pixels(order_, wanted);
    const GuidingView guide = view();
    const Clock::time_point begin = Clock::now();
    context_.guide = &guide;
    const TrainingPlan plan{first_sample_,
                            samples,
                            settings_.max_depth,
                            grid_,
                            guide,
                            tiles_ ? &*tiles_ : nullptr,
                            costs_,
                            settings_.roulette_depth};
    const double cost = trace_training_paths(context_, waves_, pixels, plan, training_samples_,
                                             [this] { return ended(); });
    if (ended()) return cost;
    first_sample_ += samples;
    statistics_.paths += training_samples_.luminances.size();
    ++statistics_.rounds;
    std::vector<uint32_t> of_paths;
    for (const uint32_t pixel : pixels) of_paths.insert(of_paths.end(), samples, pixel);
    if (!tiles_) tiles_.emplace(settings_, of_paths, training_samples_.luminances);
    auto next = std::make_shared<GuidingField>(grid_, training_samples_.records,
                                               scene_.materials().size(), round == 0, guides(),
                                               size_t{settings_.learn_memory_mb} << 20);
    std::optional<double> spread;
    if (round + 1 == kTrainingRounds && tiles_->is_lit()) spread = spread_with(*next);
    if (ended()) return cost;
    const PathStatistics mean = mean_path(training_samples_, of_paths, *tiles_, spread);
    if (mean.vertices > 0) statistics_.survival = mean.survivors / mean.vertices;
    next->compute_survival(training_samples_.bounces, mean);
    field_ = std::move(next);
    training_s_ += seconds_since(begin);
    return cost;
  }

  /// Returns the variance of a path guided by `field`, for samples distributed as in the image.
  double spread_with(const GuidingField& field) const {
    GuidingView trained = field.view();
    tiles_->apply(trained);
    const auto subset = subset_of_pixels(order_, budget_ / kSpreadShare / (2 * kSpreadSamples));
    const PilotRender pilot = render_pilot(
        context_, settings_, waves_,
        {.pixels = subset, .samples = kSpreadSamples, .guide = &trained, .grid = grid_},
        [this] { return ended(); });
    return 0.5 * kSpreadSamples * error_of(pilot, subset, *tiles_);
  }

  const Clock::time_point start_ = Clock::now();
  const Settings pilot_settings_;  ///< settings of the whole image
  Settings settings_;              ///< settings of the training paths
  const WaveSetup waves_;
  const Scene& scene_;
  uint64_t budget_;
  const std::function<bool()>& stopped_;
  const AovTables aovs_;
  Film film_;
  WaveContext context_;
  const CostSnapshot shading_;
  const PathCosts costs_;
  const GuidingGrid grid_;
  const std::vector<uint32_t> order_;
  const uint32_t pilot_samples_;
  const std::vector<uint32_t> pilot_pixels_;
  double max_s_ = std::numeric_limits<double>::infinity();
  double training_s_ = 0;  ///< time of the rounds, without pilot renders
  /// Number of training paths that cost as much as the image, if known.
  double image_paths_ = std::numeric_limits<double>::infinity();
  TrainingSamples training_samples_;
  uint32_t first_sample_ = 0;
  std::optional<ImageTiles> tiles_;
  std::shared_ptr<const GuidingField> field_;
  GuidingStatistics statistics_;
};

}  // namespace

GuidingView view_of(const GuidingTraining& training) {
  GuidingView view = training.field->view();
  if (training.tiles) training.tiles->apply(view);
  return view;
}

GuidingGrid grid_of(const Scene& scene) {
  const Bounds& b = scene.bounds();
  return {{b.lo.x, b.lo.y, b.lo.z}, {b.hi.x, b.hi.y, b.hi.z}};
}

bool needs_training(const Settings& settings) {
  return settings.guiding != Guiding::kOff || settings.roulette == RouletteKind::kEfficient;
}

GuidingTraining train_guiding(const WaveContext& render, const Scene& scene, const WaveSetup& waves,
                              const std::function<bool()>& stopped) {
  const Settings& settings = *render.settings;
  const uint64_t budget = training_paths(settings, waves.threads);
  if (!needs_training(settings) || settings.max_depth == 0 || budget == 0) return {};
  return Trainer(render, scene, waves, budget, stopped).train();
}

}  // namespace wavecomb
