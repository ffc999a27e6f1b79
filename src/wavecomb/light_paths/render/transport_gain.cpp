// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/light_paths/render/transport_gain.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <span>

#include "wavecomb/core/vec.h"

namespace wavecomb {
namespace {

/// Cost of shading a vertex of a camera path in kernels without and with support of light paths,
/// and cost of a vertex of a light path, in units of the cost of one ray. With them, the predicted
/// times of 11 stages with one light path per camera path are within 15 % of measured times.
constexpr double kPathVertex = 0.7, kJointVertex = 0.8, kLightVertex = 1.5;
/// Additional costs of a camera path and of a light path vertex in renders with merging, in units
/// of the cost of one ray.
constexpr double kMergedPath = 1, kMergedVertex = 1;
/// A second noise estimate leaves out the noisiest pixels, which are this fraction of all pixels.
constexpr double kNoisiest = 0.01;
/// Effective number of pixels at which both estimates have the same weight. In a small image, a
/// single pixel may cause most of the noise, which then says little about other pilot renders.
constexpr double kReliablePixels = 10;
/// Upper limit of a pixel's estimated squared error in a render without light paths, relative to
/// the squared radiance that light paths contribute to the pixel. Light that camera paths rarely
/// sample leaves nearly all pixels black and makes a few pixels far too bright.
constexpr double kMaxLost = 8;

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

PilotWork mean_work(const std::array<TransportPilot, 2>& pilots) {
  const PilotWork &a = pilots[0].work, &b = pilots[1].work;
  return {0.5 * (a.rays + b.rays), 0.5 * (a.records + b.records)};
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

/// Returns how many pixels there are without the noisiest ones.
ptrdiff_t most_of(const PixelNoise& noise) {
  return std::ssize(noise) - static_cast<ptrdiff_t>(kNoisiest * static_cast<double>(noise.size()));
}

/// Returns the sum of the noise over all pixels, the sum without the noisiest pixels (a fraction
/// `kNoisiest` of all pixels), and the effective number of pixels.
PilotError sums(PixelNoise noise) {
  PilotError error;
  double squares = 0;
  for (const double n : noise) {
    error.all += n;
    squares += n * n;
  }
  error.pixels = ratio_of(error.all * error.all, squares);
  const auto most = noise.begin() + most_of(noise);
  std::nth_element(noise.begin(), most, noise.end());
  error.of_most = std::accumulate(noise.begin(), most, 0.0);
  return error;
}

/// Returns whether the images of a ratio were rendered.
bool is_rendered(const std::array<TransportPilot, 2>& with) {
  return !with[0].beauty.empty() && !with[1].beauty.empty();
}

/// Returns the images of the smallest ratio that has images.
const std::array<TransportPilot, 2>& smallest_ratio(const TransportPilots& pilots) {
  return *std::ranges::find_if(pilots.with, is_rendered);
}

/// Computes `missed_light` with the given values of 1 / brightness^2 for each pixel, and the noise
/// without light paths.
double missed_light(const TransportPilots& pilots, const std::vector<double>& scale,
                    const PixelNoise& noise) {
  const auto& with = smallest_ratio(pilots);
  std::vector<size_t> order(noise.size());
  std::iota(order.begin(), order.end(), size_t{0});
  const auto most = order.begin() + most_of(noise);
  std::nth_element(order.begin(), most, order.end(),
                   [&](size_t a, size_t b) { return noise[a] < noise[b]; });
  double by_light_paths = 0, found = 0;
  for (size_t seed = 0; seed < with.size(); ++seed)
    for (const size_t i : std::span(order.begin(), most)) {
      const double light = brightness(with[seed].by_light_paths, i);
      const double camera = double{brightness(with[seed].beauty, i)} - light;
      const double weight = std::sqrt(scale[i]);
      by_light_paths += weight * light;
      found += weight * (double{brightness(pilots.path[seed].beauty, i)} - camera);
    }
  return 1 - std::clamp(ratio_of(found, by_light_paths), 0.0, 1.0);
}

PixelNoise noise_without(const TransportPilots& pilots, const std::vector<double>& scale) {
  return noise_between(pilots.path[0].beauty, pilots.path[1].beauty, scale);
}

/// Returns the squared relative error times cost without light paths. `scale` holds
/// 1 / brightness^2 for each pixel.
PilotError error_without(const TransportPilots& pilots, const std::vector<double>& scale,
                         double longer) {
  PixelNoise noise = noise_without(pilots, scale);
  PixelNoise by_missed(pilots.variance.size());
  const auto& [first, second] = smallest_ratio(pilots);
  const double missed = missed_light(pilots, scale, noise);
  for (size_t i = 0; i < by_missed.size(); ++i) {
    const double l0 = brightness(first.by_light_paths, i);
    const double l1 = brightness(second.by_light_paths, i);
    const double bound = kMaxLost * std::max(0.0, l0 * l1) * longer;
    by_missed[i] = missed * std::min(pilots.variance[i] / kTransportSamples, bound) * scale[i];
  }
  const double cost = mean_work(pilots.path).cost(kPathVertex);
  const PilotError camera = sums(std::move(noise)), left = sums(std::move(by_missed));
  const double all = camera.all + left.all;
  const double squares =
      ratio_of(camera.all * camera.all, camera.pixels) + ratio_of(left.all * left.all, left.pixels);
  return {all * cost, (camera.of_most + left.all) * cost, ratio_of(all * all, squares)};
}

/// Squared relative error and cost of a ratio of light paths.
struct RatioEstimate {
  PilotError noise, light;  ///< of the image, and of the part that light paths contribute
  double cost = 0, light_cost = 0;

  PilotError error() const { return {noise.all * cost, noise.of_most * cost, noise.pixels}; }
};

RatioEstimate estimate(const TransportPilots& pilots, size_t ratio,
                       const std::vector<double>& scale) {
  const auto& with = pilots.with[ratio];
  const PilotWork work = mean_work(with), without = mean_work(pilots.path);
  RatioEstimate found;
  const double light_vertices = std::max(0.0, work.records - without.records);
  found.cost =
      work.rays + kJointVertex * (work.records - light_vertices) + kLightVertex * light_vertices;
  if (pilots.merges)
    found.cost += kMergedPath * kTransportSamples * static_cast<double>(scale.size()) +
                  kMergedVertex * light_vertices;
  found.light_cost = std::max(0.0, found.cost - without.cost(kJointVertex));
  found.noise = sums(noise_between(with[0].beauty, with[1].beauty, scale));
  found.light = sums(noise_between(with[0].by_light_paths, with[1].by_light_paths, scale));
  return found;
}

/// Returns the estimate for `factor` times as many light paths. The noise of light paths is
/// inversely proportional to their number.
RatioEstimate with_more_paths(RatioEstimate estimate, double factor) {
  const auto fewer = [&](double noise, double light) {
    return std::max(0.0, noise - light) + light / factor;
  };
  estimate.noise = {fewer(estimate.noise.all, estimate.light.all),
                    fewer(estimate.noise.of_most, estimate.light.of_most), estimate.noise.pixels};
  estimate.light.all /= factor;
  estimate.light.of_most /= factor;
  estimate.cost += (factor - 1) * estimate.light_cost;
  estimate.light_cost *= factor;
  return estimate;
}

/// Returns the ratio of two errors: the weighted geometric mean of the ratio over all pixels and
/// the ratio without the noisiest pixels.
double ratio_of(const PilotError& a, const PilotError& b) {
  const double pixels = std::min(a.pixels, b.pixels);
  // Where only the noisiest pixels are noisy, the second ratio is undefined.
  const bool is_defined = a.of_most > 0 && b.of_most > 0;
  const double weight = is_defined ? pixels / (pixels + kReliablePixels) : 1;
  return std::pow(ratio_of(a.all, b.all), weight) *
         std::pow(ratio_of(a.of_most, b.of_most), 1 - weight);
}

/// Returns 1 / brightness^2 of each pixel.
std::vector<double> inverse_squares(const TransportPilots& pilots) {
  const auto rendered = std::ranges::count_if(pilots.with, is_rendered);
  std::vector<double> mean(pilots.path[0].beauty.size() / 3);
  for (const auto& with : pilots.with)
    if (is_rendered(with))
      for (size_t i = 0; i < mean.size(); ++i)
        for (const TransportPilot& t : with)
          mean[i] += 0.5 / static_cast<double>(rendered) * double{brightness(t.beauty, i)};
  return inverse_squares(mean, pilots.width);
}

}  // namespace

double missed_light(const TransportPilots& pilots) {
  const std::vector<double> scale = inverse_squares(pilots);
  return missed_light(pilots, scale, noise_without(pilots, scale));
}

TransportGain transport_gain(const TransportPilots& pilots, double longer) {
  const std::vector<double> scale = inverse_squares(pilots);
  TransportGain best;
  best.without = error_without(pilots, scale, longer);
  for (size_t k = 0; k < kCandidateShares.size(); ++k) {
    if (!is_rendered(pilots.with[k])) continue;
    const RatioEstimate found = estimate(pilots, k, scale);
    const double gain = ratio_of(best.without, found.error());
    if (gain <= best.gain) continue;
    best.gain = gain;
    best.share = kCandidateShares[k];
    best.with = found.error();
    const auto camera_part = [](double light, double whole) {
      return 1 - std::clamp(ratio_of(light, whole), 0.0, 1.0);
    };
    best.camera = {camera_part(found.light.of_most, found.noise.of_most),
                   camera_part(found.light_cost, found.cost)};
  }
  return best;
}

double possible_gain(const TransportPilots& pilots, double longer) {
  const std::vector<double> scale = inverse_squares(pilots);
  const PilotError path = error_without(pilots, scale, longer);
  const RatioEstimate few = estimate(pilots, 0, scale);
  const double factor = double{kCandidateShares[1].paths()} / double{kCandidateShares[0].paths()};
  return std::max(ratio_of(path, few.error()),
                  ratio_of(path, with_more_paths(few, factor).error()));
}

double merging_gain(const TransportGain& merged, const TransportGain& unmerged) {
  const auto unmerged_error = [](double with, double hidden) {
    return with + std::max(hidden, 0.0);
  };
  const PilotError error = {
      unmerged_error(unmerged.with.all, merged.without.all - unmerged.without.all),
      unmerged_error(unmerged.with.of_most, merged.without.of_most - unmerged.without.of_most),
      merged.without.pixels};
  return ratio_of(error, merged.with);
}

}  // namespace wavecomb
