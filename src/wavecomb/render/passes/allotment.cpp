// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/render/passes/allotment.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>

#include "wavecomb/core/encoding/hash.h"

namespace wavecomb {
namespace {

constexpr uint32_t kMinPilot = 8, kMaxPilot = 64, kTimedPilot = 16;
/// Fraction of the typical brightness of the image below which noise is not visible. Darker pixels
/// get the weight of a pixel of this brightness.
constexpr double kDarkShare = 0.25;

/// Measurements of the pilot render, for each pixel.
struct Pilot {
  std::vector<double> error;  ///< standard deviation divided by brightness; negative if unknown
  std::vector<double> cost;   ///< mean cost of a sample; empty if not measured
};

double light_of(const Film& film, size_t pixel) {
  const Film::Pixel& p = film.pixel(pixel);
  double light = (p.r + p.g + p.b) / (3.0 * std::max(1u, p.samples));
  if (!film.splats().empty()) {
    const std::array<double, 3> splats = film.splats().mean(pixel);
    light += (splats[0] + splats[1] + splats[2]) / 3.0;
  }
  return std::isfinite(light) ? std::max(0.0, light) : 0.0;
}

/// Returns the typical brightness of the image: the square of the mean of all pixels' square roots.
/// A few bright pixels hardly change this value.
double typical_brightness(const Film& film) {
  double root = 0;
  for (size_t i = 0; i < film.pixel_count(); ++i) root += std::sqrt(light_of(film, i));
  root /= static_cast<double>(film.pixel_count());
  return root * root;
}

Pilot measure(Film& film, bool with_cost) {
  const double dark = kDarkShare * typical_brightness(film);
  const size_t count = film.pixel_count();
  Pilot pilot;
  pilot.error.resize(count, -1);
  if (with_cost) pilot.cost.resize(count);
  for (size_t i = 0; i < count; ++i) {
    const Film::Pixel& p = film.pixel(i);
    const double* m2 = film.error(i).m2;
    const double variance = (m2[0] + m2[1] + m2[2]) / (3.0 * std::max(1u, p.samples - 1));
    const double light = light_of(film, i);
    if (std::isfinite(variance)) {
      const double scale = light * light + dark * dark;
      pilot.error[i] = scale > 0 ? std::sqrt(std::max(0.0, variance) / scale) : 0.0;
    }
    if (with_cost) {
      const double* sum = film.aovs().sums(Aov::kCost, i);
      pilot.cost[i] = *sum / std::max(1u, p.samples);
    }
  }
  return pilot;
}

/// Returns, for each pixel, the mean value of the pixels in the window around it. The mean excludes
/// the pixel itself and negative values.
std::vector<double> means_around(const std::vector<double>& values, uint32_t width,
                                 uint32_t height) {
  constexpr auto kSide = static_cast<int64_t>(kAllocationWindow);
  std::vector<double> out(values.size());
  for (int64_t y = 0; y < height; ++y)
    for (int64_t x = 0; x < width; ++x) {
      double sum = 0;
      uint32_t known = 0;
      for (int64_t v = std::max<int64_t>(0, y - kSide);
           v <= std::min<int64_t>(height - 1, y + kSide); ++v)
        for (int64_t u = std::max<int64_t>(0, x - kSide);
             u <= std::min<int64_t>(width - 1, x + kSide); ++u) {
          const double value = values[static_cast<size_t>(v * width + u)];
          if ((u == x && v == y) || value < 0) continue;
          sum += value;
          ++known;
        }
      out[static_cast<size_t>(y * width + x)] = known > 0 ? sum / known : 0.0;
    }
  return out;
}

/// Divides the weights by their mean and clamps them. All weights become 1 if they are all 0.
void limit_weights(std::vector<double>& weights) {
  double mean = 0;
  for (const double w : weights) mean += w;
  mean /= static_cast<double>(weights.size());
  for (double& w : weights) w = mean > 0 ? std::clamp(w / mean, kMinWeight, kMaxWeight) : 1.0;
}

/// Returns the number of samples that each pixel gets after the pilot render, max(0, scale * weight
/// - pilot). `scale` is chosen so that the numbers add up to `total`.
std::vector<double> fill_up(const std::vector<double>& weights, double pilot, double total) {
  double scale = 0;
  for (int round = 0; round < 64; ++round) {
    double sum = 0, over = 0;
    for (const double w : weights)
      if (scale == 0 || scale * w > pilot) {
        sum += w;
        over += pilot;
      }
    const double next = (total + over) / sum;
    if (next == scale) break;
    scale = next;
  }
  std::vector<double> more(weights.size());
  for (size_t i = 0; i < more.size(); ++i) more[i] = std::max(0.0, scale * weights[i] - pilot);
  return more;
}

/// Rounds `parts` to integers that add up to `total`. A hash of the pixel index decides whether a
/// part is rounded up or down, so that its expected value is unchanged.
std::vector<uint32_t> round_parts(const std::vector<double>& parts, uint64_t total, uint32_t seed) {
  const size_t count = parts.size();
  std::vector<uint32_t> out(count);
  uint64_t given = 0;
  for (size_t i = 0; i < count; ++i) {
    const double u =
        std::ldexp(static_cast<double>(hash_u32<uint32_t>(static_cast<uint32_t>(i), seed)), -32);
    given += out[i] = static_cast<uint32_t>(std::floor(parts[i] + u));
  }
  // If the sum of the rounded parts differs from `total`, change the counts of evenly spaced pixels
  // by one.
  while (given != total) {
    const uint64_t wrong = std::min<uint64_t>(given < total ? total - given : given - total, count);
    const uint64_t before = given;
    for (uint64_t k = 0; k < wrong; ++k) {
      uint32_t& n = out[k * count / wrong];
      if (before < total) {
        ++n;
        ++given;
      } else if (n > 0) {
        --n;
        --given;
      }
    }
    // all visited pixels have 0 samples, so take the sample from another pixel
    if (given == before) {
      --*std::find_if(out.begin(), out.end(), [](uint32_t n) { return n > 0; });
      --given;
    }
  }
  return out;
}

double expected_gain(const std::vector<double>& errors, const std::vector<double>& costs,
                     const SampleAllocation& allocation) {
  double even_error = 0, even_cost = 0, error = 0, cost = 0;
  for (size_t i = 0; i < errors.size(); ++i) {
    const double squared = errors[i] * errors[i], c = costs.empty() ? 1.0 : costs[i];
    const double n = allocation.counts[i], even = allocation.spp;
    even_error += squared / even;
    even_cost += c * even;
    error += squared / n;
    cost += c * n;
  }
  return error > 0 && cost > 0 ? even_error * even_cost / (error * cost) : 1.0;
}

}  // namespace

uint32_t pilot_samples(const Settings& settings) {
  if (!settings.allocates_samples() || settings.spp < 2 * kMinPilot) return 0;
  const uint32_t quarter = std::clamp(std::bit_floor(settings.spp / 4), kMinPilot, kMaxPilot);
  return settings.time_limit > 0 ? std::min(quarter, kTimedPilot) : quarter;
}

SampleAllocation allocate_samples(Film& film, const Settings& settings,
                                  AllocationStatistics& facts) {
  const bool by_cost = settings.allocate == Allocate::kEfficiency;
  const Pilot pilot = measure(film, by_cost);
  const std::vector<double> errors = means_around(pilot.error, film.width(), film.height());
  const std::vector<double> costs =
      by_cost ? means_around(pilot.cost, film.width(), film.height()) : std::vector<double>();
  std::vector<double> weights = errors;
  if (by_cost)
    for (size_t i = 0; i < weights.size(); ++i)
      if (costs[i] > 0) weights[i] /= std::sqrt(costs[i]);
  limit_weights(weights);

  SampleAllocation out{pilot_samples(settings), settings.spp, {}};
  const uint32_t more = out.spp - out.pilot;
  // Sample counts are multiples of a quantum. The samples of a pixel then form nets of the Sobol
  // sequence, and few different counts occur, which keeps waves full.
  const uint32_t quantum = std::max(1u, std::bit_floor(settings.spp) / 8);
  const uint32_t quanta = more / quantum;
  const size_t count = film.pixel_count();
  std::vector<double> parts =
      fill_up(weights, out.pilot, static_cast<double>(more) * static_cast<double>(count));
  const double scale = static_cast<double>(quanta) / more;
  for (double& part : parts) part *= scale;
  out.counts = round_parts(parts, uint64_t{quanta} * count, settings.seed);
  for (uint32_t& n : out.counts) n = out.pilot + more % quantum + n * quantum;
  const auto [least, most] = std::minmax_element(out.counts.begin(), out.counts.end());
  facts = {out.pilot, *least, *most, expected_gain(errors, costs, out)};
  return out;
}

}  // namespace wavecomb
