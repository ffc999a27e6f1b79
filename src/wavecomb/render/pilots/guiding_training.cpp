// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/render/pilots/guiding_training.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>
#include <span>
#include <utility>

#include "wavecomb/core/clock.h"
#include "wavecomb/guiding/bounce/bounce_reader.h"
#include "wavecomb/render/passes/pixel_order.h"
#include "wavecomb/render/pilots/guiding_pilot.h"
#include "wavecomb/wave/wave.h"

namespace wavecomb {
namespace {

/// Training traces one path for every kTrainingShare samples of the render, within the limits
/// kMinTrainingPaths and kMaxTrainingPaths.
constexpr uint64_t kTrainingShare = 8, kMaxTrainingPaths = 700'000, kMinTrainingPaths = 16'384;
/// For Guiding::kAuto: minimum number of samples of a render for which a pilot render is
/// worthwhile. The first two rounds trace one training path for every kAutoShares[round] samples of
/// the render. The second round takes place only if the field of the first round reduces noise.
constexpr uint64_t kMinAutoSamples = 2'000'000;
constexpr std::array<uint64_t, 2> kAutoShares = {200, 40};
constexpr uint64_t kMaxFirstPaths = 30'000, kMaxSecondPaths = 150'000;
/// Camera samples and training paths per thread and second, assumed before the first round is
/// timed. Training may take the time limit divided by kTimeShare.
constexpr double kSamplesPerSecond = 250'000, kTrainingPathsPerSecond = 50'000, kTimeShare = 8;
/// For Guiding::kAuto, training gives up after the time limit divided by kMaxTimeShare, or by
/// kMaxGuidedTimeShare once guiding is known to reduce noise.
constexpr double kMaxTimeShare = 20, kMaxGuidedTimeShare = 4;
/// Cost of a training path with the recording and sorting of its vertices, relative to the cost of
/// its rays and shading.
constexpr double kRecordingCost = 1.5;
/// Each image of a pilot render has one sample for every kPilotShare samples of the render, within
/// the limits below. The number of samples per pixel is also limited. A pilot render has fewer
/// pixels rather than fewer samples per pixel: the noise of Sobol samples falls faster for smooth
/// integrands, and guiding makes the integrand less smooth, so gains at low sample counts would be
/// misleading.
constexpr uint64_t kPilotShare = 320, kMinPilotPaths = 2048, kMaxPilotPaths = 65'536;
constexpr uint32_t kMinPilotSamples = 16, kMaxPilotSamples = 32;
/// After the first round, the pilot render begins with one of every kFirstPixels pixels. If the
/// gain there is below kHopelessGain by more than its standard error, the other pixels are not
/// rendered.
constexpr size_t kFirstPixels = 4;
constexpr double kHopelessGain = 0.8;
/// Number of samples per pixel that estimate the variance for learned roulette.
constexpr uint32_t kSpreadSamples = 16;
/// For learned roulette, one path for every kSpreadShare training paths estimates the variance.
constexpr uint64_t kSpreadShare = 8;
/// Least measured gains in efficiency for which training continues after the first and the second
/// round. The render is guided if the gain after the second round, less its standard error, reaches
/// the second value.
constexpr std::array<double, 2> kMinGains = {1.1, 1.25};
/// Gain at which the third round uses the full training budget of Guiding::kOn. With a lower gain,
/// it uses half of this budget.
constexpr double kFullTrainingGain = 1.5;
constexpr uint32_t kTrainingRounds = 3;

/// Converts to a number of paths, at most kMaxTrainingPaths.
uint64_t as_count(double paths) {
  return static_cast<uint64_t>(std::min(paths, static_cast<double>(kMaxTrainingPaths)));
}

uint64_t samples_of(const Settings& settings) {
  return uint64_t{settings.width} * settings.height * settings.spp;
}

/// Returns the number of training paths of a render with Guiding::kOn.
uint64_t training_paths(const Settings& settings, uint32_t threads) {
  uint64_t paths = std::min(samples_of(settings) / kTrainingShare, kMaxTrainingPaths);
  if (settings.time_limit > 0)
    paths = std::min(paths, as_count(double{settings.time_limit} * threads *
                                     kTrainingPathsPerSecond / kTimeShare));
  return paths;
}

/// A training run with all its rounds. For Guiding::kAuto, the class also decides whether training
/// continues and whether the render uses the guiding field.
class Trainer {
 public:
  Trainer(const TrainingInput& render, const std::function<bool()>& stopped)
      : pilot_settings_(whole_image(*render.context.settings)),
        settings_(pilot_settings_),
        waves_(render.waves),
        scene_(render.scene),
        camera_(render.camera),
        samples_(expected_samples(settings_, waves_.threads)),
        budget_(training_paths(settings_, waves_.threads)),
        stopped_(stopped),
        aovs_(scene_, pilot_settings_),
        film_(1, 1, aovs_.layout),
        context_(render.context),
        shading_(model_costs(scene_)),
        costs_{context_.accel->has_list() ? kListRay : 1.0, guides() ? kGuidedRays : 0, &shading_},
        grid_(grid_of(scene_)),
        order_(morton_pixel_order({0, 0, settings_.width, settings_.height})),
        pilot_samples_(std::clamp(settings_.spp, kMinPilotSamples, kMaxPilotSamples)),
        pilot_pixels_(pixels_of_pilot()),
        field_(std::make_shared<const GuidingField>(grid_)) {
    settings_.seed = 0x2545f491u;
    // Disable roulette, which multiplies the contribution of surviving paths. The added noise would
    // hide the gain of guiding.
    settings_.roulette = RouletteKind::kOff;
    if (is_auto() && is_timed()) max_s_ = double{settings_.time_limit} / kMaxTimeShare;
    context_.settings = &settings_;
    context_.film = &film_;
    // The film of training has neither sums of light splats nor merge points.
    context_.joint.disable_splats();
    context_.aovs = nullptr;
    context_.recorder = nullptr;
    context_.discards = true;
  }

  GuidingTraining train() {
    if (is_auto()) return train_if_it_pays();
    for (uint32_t round = 0; round < kTrainingRounds && !ended(); ++round) {
      run(round, (budget_ << round) / ((1u << kTrainingRounds) - 1));
      if (is_timed() && !ended()) budget_ = max_paths();
    }
    return result(field_->facts().regions > 0 && !ended());
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

  /// Trains for Guiding::kAuto. After each of the first two rounds, a pilot render decides whether
  /// to continue.
  GuidingTraining train_if_it_pays() {
    PilotRender without = pilot(first_pixels(), nullptr);
    for (uint32_t round = 0; round < kMinGains.size(); ++round) {
      const uint64_t most = round == 0 ? kMaxFirstPaths : kMaxSecondPaths;
      const double cost = run(round, std::min(samples_ / kAutoShares[round], most));
      if (ended()) return result(false);
      if (round == 0) measure_speed(cost, without);
      if (!pays(round, without)) return result(false);
    }
    // The render will be guided, so more training is worthwhile because it improves the guiding
    // field.
    if (is_timed()) max_s_ = double{settings_.time_limit} / kMaxGuidedTimeShare;
    budget_ = max_paths();
    if (statistics_.gain < kFullTrainingGain) budget_ /= 2;
    const uint64_t more = std::max(budget_, 2 * statistics_.paths) - statistics_.paths;
    run(kTrainingRounds - 1, more);
    return result(!ended());
  }

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

  /// Returns the pixels of the pilot renders, starting with those of the first part.
  std::vector<uint32_t> pixels_of_pilot() const {
    const uint64_t paths = std::clamp(samples_ / kPilotShare, kMinPilotPaths, kMaxPilotPaths);
    const std::vector<uint32_t> all = subset_of_pixels(order_, paths / pilot_samples_);
    std::vector<uint32_t> pixels, others;
    for (size_t i = 0; i < all.size(); ++i)
      (i % kFirstPixels == 0 ? pixels : others).push_back(all[i]);
    pixels.insert(pixels.end(), others.begin(), others.end());
    return pixels;
  }
  std::span<const uint32_t> first_pixels() const {
    const std::span<const uint32_t> all = pilot_pixels_;
    return all.first((all.size() + kFirstPixels - 1) / kFirstPixels);
  }
  std::span<const uint32_t> other_pixels() const {
    return std::span<const uint32_t>(pilot_pixels_).subspan(first_pixels().size());
  }

  PilotRender pilot(std::span<const uint32_t> pixels, const GuidingView* guide) const {
    return render_pilot(context_, pilot_settings_, waves_,
                        {.pixels = pixels, .samples = pilot_samples_, .guide = guide},
                        [this] { return ended(); });
  }

  GuidingView view() const {
    GuidingView view = field_->view();
    if (tiles_) tiles_->apply(view);
    return view;
  }

  /// Returns whether training is worthwhile after `round`, and measures the gain in efficiency of
  /// the current field. `without` is a pilot render without guiding. In round 0 it has only the
  /// first pixels, and this function adds the other pixels if needed.
  bool pays(uint32_t round, PilotRender& without) {
    if (!tiles_->is_lit() || field_->facts().regions == 0) return false;
    const GuidingView guide = view();
    PilotRender with = pilot(first_pixels(), &guide);
    if (round == 0) {
      compare(with, without);
      const double highest = statistics_.gain * std::exp(log_gain_error(with, without));
      if (highest < kHopelessGain || ended()) return false;
      without.append(pilot(other_pixels(), nullptr));
    }
    with.append(pilot(other_pixels(), &guide));
    compare(with, without);
    // A gain that a few pixels determine may be chance, and guiding makes some images noisier.
    const bool is_last = round + 1 == kMinGains.size();
    const double error = is_last ? log_gain_error(with, without) : 0.0;
    return statistics_.gain * std::exp(-error) >= kMinGains[round] && !ended();
  }

  /// Sets the gain in efficiency from two pilot renders of the same pixels.
  void compare(const PilotRender& with, const PilotRender& without) {
    const auto pixels = std::span<const uint32_t>(pilot_pixels_).first(with.differences.size());
    const double factor = error_factor(with, without, pixels);
    if (factor > 0 && with.cost > 0 && !ended())
      statistics_.gain = camera_.gain(factor, with.cost / without.cost);
  }

  /// Returns the factor by which guiding changes the squared error, or 0 if it is not known.
  double error_factor(const PilotRender& with, const PilotRender& without,
                      std::span<const uint32_t> pixels) const {
    const double unguided = error_of(without, pixels, *tiles_);
    return unguided > 0 ? error_of(with, pixels, *tiles_) / unguided : 0;
  }

  /// Returns the standard error of the logarithm of the gain.
  double log_gain_error(const PilotRender& with, const PilotRender& without) const {
    const auto pixels = std::span<const uint32_t>(pilot_pixels_).first(with.differences.size());
    return camera_.error_after(error_factor(with, without, pixels)) *
           log_ratio_error(with, without, pixels, *tiles_);
  }

  /// Sets the number of training paths that cost as much as the image. `cost` is the cost of the
  /// first round's paths.
  void measure_speed(double cost, const PilotRender& without) {
    const double path = kRecordingCost * cost / static_cast<double>(statistics_.paths);
    if (path > 0) image_paths_ = static_cast<double>(samples_) * without.cost_of_sample() / path;
  }

  /// Returns the maximum number of training paths for a render that will be guided, estimated from
  /// the speed so far.
  uint64_t max_paths() const {
    const uint64_t most = std::min(samples_of(settings_) / kTrainingShare, kMaxTrainingPaths);
    if (!is_timed()) return std::min(most, as_count(image_paths_ / kTrainingShare));
    const auto trained = static_cast<double>(statistics_.paths);
    const double left = double{settings_.time_limit} / kTimeShare - seconds_since(start_);
    return std::min(most, as_count(trained * (1 + std::max(0.0, left) / training_s_)));
  }

  /// Traces the `wanted` paths of a round and builds the field from all training samples so far.
  /// Returns the cost of the paths.
  double run(uint32_t round, uint64_t wanted) {
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
    const PilotRender pilot =
        render_pilot(context_, settings_, waves_,
                     {.pixels = subset, .samples = kSpreadSamples, .guide = &trained},
                     [this] { return ended(); });
    return 0.5 * kSpreadSamples * error_of(pilot, subset, *tiles_);
  }

  const Clock::time_point start_ = Clock::now();
  const Settings pilot_settings_;  ///< settings of the whole image
  Settings settings_;              ///< settings of the training paths
  const WaveSetup waves_;
  const Scene& scene_;
  const CameraPathPart camera_;
  const uint64_t samples_;  ///< expected number of samples of the render
  uint64_t budget_;         ///< number of training paths
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

uint64_t expected_samples(const Settings& settings, uint32_t threads) {
  const uint64_t samples = samples_of(settings);
  if (!(settings.time_limit > 0)) return samples;
  const double in_time = double{settings.time_limit} * threads * kSamplesPerSecond;
  return in_time < static_cast<double>(samples) ? static_cast<uint64_t>(in_time) : samples;
}

bool needs_training(const Settings& settings) {
  return settings.guiding != Guiding::kOff || settings.roulette == RouletteKind::kEfficient;
}

GuidingTraining train_guiding(const TrainingInput& render, const std::function<bool()>& stopped) {
  const Settings& settings = *render.context.settings;
  const uint32_t threads = render.waves.threads;
  if (!needs_training(settings) || settings.max_depth == 0) return {};
  const bool is_long_enough = settings.guiding == Guiding::kAuto
                                  ? expected_samples(settings, threads) >= kMinAutoSamples
                                  : training_paths(settings, threads) >= kMinTrainingPaths;
  if (!is_long_enough) return {};
  return Trainer(render, stopped).train();
}

}  // namespace wavecomb
