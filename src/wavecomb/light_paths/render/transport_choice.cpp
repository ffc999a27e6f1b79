// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/light_paths/render/transport_choice.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>

#include "wavecomb/core/clock.h"
#include "wavecomb/core/path_expressions/backward_automaton.h"
#include "wavecomb/material/lobes/ggx.h"
#include "wavecomb/wave/wave.h"

namespace wavecomb {
namespace {

/// Samples per pixel of a pilot render, and limits of its number of pixels. This number of samples
/// suffices to show the effects of Sobol sequences and of roulette.
constexpr uint32_t kTransportSamples = 8;
constexpr uint64_t kMinTransportPixels = 400, kMaxTransportPixels = 16'384;
/// A pilot render takes one sample for every kTransportShare samples of the render. There are five
/// pilot renders, of which three cost two or three times as much as the other two. Together they
/// take about a hundredth of the render time.
constexpr uint64_t kTransportShare = 1000;
constexpr std::array<uint32_t, 2> kTransportSeeds = {0x3c6ef372u, 0xa54ff53au};
/// Cost of shading a vertex in kernels without and with support of light paths, in units of the
/// cost of one ray.
constexpr double kPathVertex = 0.7, kJointVertex = 0.8;
/// Additional costs of a camera path and of a light path vertex in renders with merging, in units
/// of the cost of one ray.
constexpr double kMergedPath = 1, kMergedVertex = 1;
/// A second noise estimate leaves out the noisiest pixels, which are this fraction of all pixels.
/// In a small image, a single pixel may cause most of the noise, and results then differ between
/// pilot renders.
constexpr double kNoisiest = 0.01;
/// Upper limit of a pixel's estimated squared error in a render without light paths, relative to
/// the squared radiance that light paths contribute to the pixel. Light that camera paths rarely
/// sample leaves nearly all pixels black and makes a few pixels far too bright.
constexpr double kMaxLost = 8;
/// Minimum predicted gain in efficiency for which light paths are used.
constexpr double kMinLightPathGain = 1.3;
/// Minimum predicted gain of merging over light paths without merging.
constexpr double kMinMergingGain = 2;
/// Roughness below which a lobe is sharp enough for visible caustics.
constexpr float kSharpRoughness = 0.4f;

/// Returns the width and height of a pilot render for a render with settings `s`, or 0 if its
/// number of samples is too small.
std::array<uint32_t, 2> pilot_size(const Settings& s, uint64_t samples) {
  const uint64_t pixels = std::min({samples / kTransportShare / kTransportSamples,
                                    kMaxTransportPixels, uint64_t{s.width} * s.height});
  if (pixels < kMinTransportPixels) return {0, 0};
  const double shrink = std::sqrt(static_cast<double>(pixels) / (double{1} * s.width * s.height));
  const auto side = [&](uint32_t full) {
    return std::max(1u, static_cast<uint32_t>(std::lround(full * shrink)));
  };
  return {side(s.width), side(s.height)};
}

/// Returns the settings of the pilot renders, which trace light paths and store only the layers
/// that the choice needs.
Settings pilot_settings(const Settings& settings, uint32_t width, uint32_t height) {
  Settings small = settings;
  small.width = width;
  small.height = height;
  small.spp = kTransportSamples;
  small.region.reset();
  small.crop = false;
  small.time_limit = 0;
  small.firefly = Firefly::kKeep;
  small.adaptive = small.noise = 0;
  small.allocate = Allocate::kEven;
  small.error = false;
  small.costs = CostSource::kModel;
  small.light_splats =
      settings.splats_to_one_pixel() ? LightSplats::kPixel : LightSplats::kFiltered;
  small.aovs.bits = static_cast<uint32_t>(Aov::kByLightPaths);
  small.light_groups.clear();
  small.expressions.clear();
  small.transport = Transport::kLight;
  // Guiding is decided after the transport.
  small.guiding = Guiding::kOff;
  return small;
}

float brightness(const std::vector<float>& rgb, size_t pixel) {
  return luminance(Vec3<float>{rgb[3 * pixel], rgb[3 * pixel + 1], rgb[3 * pixel + 2]});
}

/// Returns 1 / (I^2 + 0.01 mean(I)^2) for each pixel, where I is the mean of the images over 3 x 3
/// pixels.
std::vector<double> inverse_squares(const std::vector<double>& mean, uint32_t width) {
  const auto height = static_cast<uint32_t>(mean.size() / width);
  double all = 0;
  for (const double v : mean) all += v / static_cast<double>(mean.size());
  std::vector<double> out(mean.size());
  for (uint32_t y = 0; y < height; ++y)
    for (uint32_t x = 0; x < width; ++x) {
      double sum = 0, count = 0;
      for (uint32_t v = y - std::min(y, 1u); v <= std::min(y + 1, height - 1); ++v)
        for (uint32_t u = x - std::min(x, 1u); u <= std::min(x + 1, width - 1); ++u) {
          sum += mean[size_t{v} * width + u];
          ++count;
        }
      const double square = sum / count * (sum / count) + 0.01 * all * all;
      out[size_t{y} * width + x] = square > 0 ? 1 / square : 0;
    }
  return out;
}

PilotWork work_of(const std::array<TransportPilot, 2>& pilots) {
  PilotWork work;
  for (const TransportPilot& t : pilots) {
    work.rays += 0.5 * static_cast<double>(t.rays);
    work.records += 0.5 * static_cast<double>(t.records);
  }
  return work;
}
/// Returns a / b, or 0 if b is 0.
double ratio_of(double a, double b) {
  return b > 0 ? a / b : 0;
}

/// Squared relative noise of each pixel.
using PixelNoise = std::vector<double>;

/// Returns the noise of two images with different seeds. `scale` holds 1 / brightness^2 for each
/// pixel.
PixelNoise noise_between(const std::vector<float>& a, const std::vector<float>& b,
                         const std::vector<double>& scale) {
  PixelNoise noise(scale.size());
  for (size_t i = 0; i < noise.size(); ++i) {
    const double d = double{brightness(a, i)} - double{brightness(b, i)};
    noise[i] = 0.5 * scale[i] * (d * d);
  }
  return noise;
}

double sum(const PixelNoise& noise) {
  return std::accumulate(noise.begin(), noise.end(), 0.0);
}

/// Returns the sum of the noise of all pixels, without the noisiest pixels (a fraction `kNoisiest`
/// of all pixels).
double sum_of_most(PixelNoise noise) {
  const auto most =
      noise.end() - static_cast<ptrdiff_t>(kNoisiest * static_cast<double>(noise.size()));
  if (most != noise.end()) std::nth_element(noise.begin(), most, noise.end());
  return std::accumulate(noise.begin(), most, 0.0);
}

/// Returns whether a lobe of the given roughness is sharp. Returns true if the roughness varies,
/// since the lobe may be sharp at some points.
bool is_sharp(float roughness, bool varies) {
  return varies || roughness < kSharpRoughness;
}

}  // namespace

PilotWork work_without(const TransportPilots& pilots) {
  const PilotWork few = work_of(pilots.with[0]), many = work_of(pilots.with[1]);
  const double a = double{kCandidateShares[0].paths()}, b = double{kCandidateShares[1].paths()};
  const auto without_light_paths = [&](double x, double y) { return (b * x - a * y) / (b - a); };
  return {without_light_paths(few.rays, many.rays), without_light_paths(few.records, many.records)};
}

TransportGain transport_gain(const TransportPilots& pilots, const PilotWork& without,
                             double longer) {
  const std::array<TransportPilot, 2>& most = pilots.with[kCandidateShares.size() - 1];
  const size_t pixels = most[0].beauty.size() / 3;
  const auto is_candidate = [](const auto& with) { return !with[0].beauty.empty(); };
  const auto candidates = std::ranges::count_if(pilots.with, is_candidate);
  std::vector<double> mean(pixels);
  for (size_t i = 0; i < pixels; ++i)
    for (const auto& with : pilots.with)
      for (const TransportPilot& t : with)
        if (!t.beauty.empty())
          mean[i] += 0.5 / static_cast<double>(candidates) * double{brightness(t.beauty, i)};
  const std::vector<double> scale = inverse_squares(mean, pilots.width);
  const auto squared = [](double d) { return d * d; };
  PixelNoise camera(pixels), left(pixels);
  for (size_t i = 0; i < pixels; ++i) {
    const double l0 = brightness(most[0].by_light_paths, i);
    const double l1 = brightness(most[1].by_light_paths, i);
    const double c0 = brightness(most[0].beauty, i) - l0, c1 = brightness(most[1].beauty, i) - l1;
    camera[i] = 0.5 * squared(c0 - c1) * scale[i];
    const double bound = kMaxLost * std::max(0.0, l0 * l1) * longer;
    left[i] = std::min(pilots.variance[i] / kTransportSamples, bound) * scale[i];
  }
  const double path_cost = without.cost(kPathVertex);
  TransportGain best;
  best.without.all = (sum(camera) + sum(left)) * path_cost;
  best.without.of_most =
      (sum_of_most(std::move(camera)) + sum_of_most(std::move(left))) * path_cost;
  for (size_t k = 0; k < kCandidateShares.size(); ++k) {
    const auto& with = pilots.with[k];
    if (!is_candidate(with)) continue;
    PixelNoise noise = noise_between(with[0].beauty, with[1].beauty, scale);
    const PilotWork work = work_of(with);
    double cost = work.cost(kJointVertex);
    if (pilots.merges)
      cost += kMergedPath * kTransportSamples * static_cast<double>(pixels) +
              kMergedVertex * (work.records - without.records);
    PilotError error;
    error.all = sum(noise) * cost;
    const double noise_of_most = sum_of_most(std::move(noise));
    error.of_most = noise_of_most * cost;
    const double light_of_most =
        sum_of_most(noise_between(with[0].by_light_paths, with[1].by_light_paths, scale));
    const double light_cost = std::max(0.0, cost - without.cost(kJointVertex));
    const double gain = std::max(ratio_of(best.without.all, error.all),
                                 ratio_of(best.without.of_most, error.of_most));
    if (gain <= best.gain) continue;
    best.gain = gain;
    best.share = kCandidateShares[k];
    best.with = error;
    const auto camera_part = [](double light, double whole) {
      return 1 - std::clamp(ratio_of(light, whole), 0.0, 1.0);
    };
    best.camera = {camera_part(light_of_most, noise_of_most), camera_part(light_cost, cost)};
  }
  return best;
}

double merging_gain(const TransportGain& merged, const TransportGain& unmerged) {
  const auto gain = [](double with, double hidden, double merged_with) {
    return ratio_of(with + std::max(hidden, 0.0), merged_with);
  };
  return std::max(
      gain(unmerged.with.all, merged.without.all - unmerged.without.all, merged.with.all),
      gain(unmerged.with.of_most, merged.without.of_most - unmerged.without.of_most,
           merged.with.of_most));
}

namespace {

/// Returns whether `is_low(roughness, varies)` for a lobe of the base or the clearcoat of `m`, or
/// whether a graph drives the material.
template <typename IsLow>
bool may_have_lobe(const Material& m, const IsLow& is_low) {
  const bool coats = m.clearcoat > 0 || m.has_texture(Input::kClearcoat);
  return has_trait(m.program, program_trait::kGlossy) &&
         (m.graph != kNoGraph || is_low(m.roughness, m.has_texture(Input::kRoughness)) ||
          (coats && is_low(m.clearcoat_roughness, m.has_texture(Input::kClearcoatRoughness))));
}

}  // namespace

bool focuses_light(const Scene& scene) {
  return std::ranges::any_of(scene.materials(), [](const Material& m) {
    const bool transmits =
        has_trait(m.program, program_trait::kGlossy) && m.openpbr.transmission_weight > 0;
    return has_trait(m.program, program_trait::kGlass) || transmits || may_have_lobe(m, is_sharp);
  });
}

namespace {

/// Returns whether the camera may see caustics in a mirror or through glass, where camera paths
/// have only delta bounces.
bool shows_caustics(const Scene& scene) {
  const auto is_smooth = [](float roughness, bool varies) {
    return varies || alpha_from_roughness(roughness) < kDeltaAlpha;
  };
  return std::ranges::any_of(scene.materials(),
                             [&](const Material& m) { return may_have_lobe(m, is_smooth); });
}

/// Renders the pilots with `small` for the candidate ratios from number `first` on. `unit` is the
/// brightness of the scene.
TransportPilots render_pilots(Settings small, double unit, size_t first, const RenderPilot& render,
                              const std::function<bool()>& stopped) {
  TransportPilots pilots;
  pilots.width = small.width;
  pilots.merges = small.merge_radius > 0;
  small.seed = kTransportSeeds[0];
  const TransportPilot squares = render(small, kCandidateShares.back(), true);
  for (size_t k = first; k < kCandidateShares.size(); ++k)
    for (size_t i = 0; i < kTransportSeeds.size(); ++i) {
      small.seed = kTransportSeeds[i];
      if (!stopped()) pilots.with[k][i] = render(small, kCandidateShares[k], false);
    }
  for (size_t i = 0; i < squares.beauty.size() / 3; ++i)
    pilots.variance.push_back(unit * brightness(squares.by_light_paths, i));
  return pilots;
}

}  // namespace

TransportChoice choose_transport(const Scene& scene, const Settings& settings, uint64_t samples,
                                 const RenderPilot& render, const std::function<bool()>& stopped) {
  const Clock::time_point start = Clock::now();
  TransportChoice choice;
  const auto reject = [&](const LightPathConflict& conflict) {
    if (!conflict.what.empty()) choice.why = "light paths do not go with " + conflict.what;
    return !conflict.what.empty();
  };
  if (settings.max_depth == 0) {
    choice.why = "no light is scattered at a maximum depth of 0";
    return choice;
  }
  if (reject(light_path_conflict(settings)) || reject(light_path_conflict(scene))) return choice;
  try {
    (void)BackwardAutomaton(PathAutomaton(settings.expressions, scene.light_groups()));
  } catch (const Error&) {
    choice.why = "light paths have no room for so many light path expressions";
    return choice;
  }
  if (!focuses_light(scene)) {
    choice.why = "nothing in the stage is clear or glossy";
    return choice;
  }
  if (!emits_paths(scene)) {
    choice.why = "no light sends paths";
    return choice;
  }
  const auto [width, height] = pilot_size(settings, samples);
  if (width == 0) {
    choice.why = "too few samples to find out whether light paths pay";
    return choice;
  }
  const Settings small = pilot_settings(settings, width, height);
  const double unit = scene_brightness(scene);
  const TransportPilots pilots = render_pilots(small, unit, 0, render, stopped);
  TransportPilots merged;
  Settings merging = settings;
  merging.merge_radius = 1.f;
  if (settings.auto_merge && settings.merge_radius == 0 && shows_caustics(scene) &&
      light_path_conflict(merging).what.empty())
    merged = render_pilots(pilot_settings(merging, width, height), unit,
                           kCandidateShares.size() - 1, render, stopped);
  choice.seconds = seconds_since(start);
  if (stopped()) {
    choice.why = "a trial took too much of the time limit";
    return choice;
  }
  const double pixels = double{1} * settings.width * settings.height;
  const double longer = static_cast<double>(samples) / pixels / kTransportSamples;
  const PilotWork without = work_without(pilots);
  TransportGain found = transport_gain(pilots, without, longer);
  if (merged.width > 0) {
    const TransportGain by_merging = transport_gain(merged, without, longer);
    choice.merges =
        by_merging.gain >= kMinLightPathGain && merging_gain(by_merging, found) >= kMinMergingGain;
    if (choice.merges) found = by_merging;
  }
  choice.gain = found.gain;
  choice.why =
      "by a trial of " + std::to_string(width) + " x " + std::to_string(height) + " pixels";
  if (found.gain >= kMinLightPathGain) {
    choice.transport = Transport::kLight;
    choice.share = found.share;
    choice.camera = found.camera;
  }
  choice.seconds = seconds_since(start);
  return choice;
}

}  // namespace wavecomb
