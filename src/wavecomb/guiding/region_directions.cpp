// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/guiding/region_directions.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <utility>
#include <vector>

#include "wavecomb/guiding/directions.h"

namespace wavecomb {
namespace {

/// Candidates for the inverse radius of the parallax sphere, in units of the mean inverse hit
/// distance.
constexpr std::array<float, 4> kInverseDistances = {0.f, 0.5f, 1.f, 1.5f};
/// Maximum number of bounces that are used to compare the candidate radii.
constexpr size_t kTried = 2048;
/// Standard deviation in radians of the blur of direction bins, and its cutoff in standard
/// deviations.
constexpr double kBlur = 0.09, kBlurReach = 3;

Vec3<float> vector_of(const float (&v)[3]) {
  return {v[0], v[1], v[2]};
}

uint32_t bin_of(const TrainingRecord& r, const ParallaxSphere& sphere) {
  const Vec3<float> offset =
      sphere_offset<float>(vector_of(r.p), vector_of(sphere.centre), sphere.inverse_distance);
  const Vec2<float> at =
      octahedral_point<float>(direction_from_centre<float>(offset, vector_of(r.wi)).w);
  const auto step = [](float x) {
    return std::min(static_cast<uint32_t>(x * kGuidingSide), kGuidingSide - 1);
  };
  return step(at.y) * kGuidingSide + step(at.x);
}

/// Computes the mean position of the bounces and the mean inverse distance of their hits, weighted
/// by contribution. Weights are clamped to `cut`.
ParallaxSphere sphere_of(Bounces bounces, double cut) {
  double centre[3] = {}, inverse_distance = 0, weight = 0;
  for (const TrainingRecord* r : bounces) {
    for (int i = 0; i < 3; ++i) centre[i] += double{r->p[i]};
    if (r->inverse_distance < 0) continue;
    const double value = std::min(double{r->value}, cut);
    inverse_distance += value * double{r->inverse_distance};
    weight += value;
  }
  ParallaxSphere sphere;
  for (int i = 0; i < 3; ++i)
    sphere.centre[i] = static_cast<float>(centre[i] / static_cast<double>(bounces.size()));
  if (weight > 0 && std::isfinite(inverse_distance))
    sphere.inverse_distance = static_cast<float>(inverse_distance / weight);
  return sphere;
}

double farthest(Bounces bounces, const ParallaxSphere& sphere) {
  double most = 0;
  for (const TrainingRecord* r : bounces) {
    double squared = 0;
    for (int i = 0; i < 3; ++i) {
      const double d = double{r->p[i]} - double{sphere.centre[i]};
      squared += d * d;
    }
    most = std::max(most, squared);
  }
  return std::sqrt(most);
}

/// For each direction bin, the bins over which the blur distributes the bin's weight, and the
/// fraction of the weight for each of these bins.
using Blur = std::array<std::vector<std::pair<uint32_t, double>>, kGuidingBins>;

Blur make_blur() {
  std::array<Vec3<float>, kGuidingBins> directions;
  for (uint32_t b = 0; b < kGuidingBins; ++b) directions[b] = bin_direction(b);
  Blur blur;
  const double least = std::cos(kBlurReach * kBlur);
  for (uint32_t b = 0; b < kGuidingBins; ++b) {
    double sum = 0;
    for (uint32_t other = 0; other < kGuidingBins; ++other) {
      const double cosine = double{dot(directions[b], directions[other])};
      if (cosine < least && other != b) continue;
      sum += blur[b].emplace_back(other, std::exp((cosine - 1) / (kBlur * kBlur))).second;
    }
    for (auto& [other, share] : blur[b]) share /= sum;
  }
  return blur;
}

}  // namespace

Vec3<float> bin_direction(uint32_t bin) {
  constexpr float width = 1.f / static_cast<float>(kGuidingSide);
  return octahedral_direction<float>((static_cast<float>(bin % kGuidingSide) + 0.5f) * width,
                                     (static_cast<float>(bin / kGuidingSide) + 0.5f) * width);
}

DirectionBins direction_bins(Bounces bounces, const ParallaxSphere& sphere, double cut) {
  DirectionBins bins{};
  for (const TrainingRecord* r : bounces)
    bins[bin_of(*r, sphere)] += std::min(double{r->value}, cut);
  return bins;
}

std::vector<const TrainingRecord*> subset_of_bounces(Bounces bounces, size_t count) {
  std::vector<const TrainingRecord*> some(std::min(bounces.size(), count));
  for (size_t i = 0; i < some.size(); ++i) some[i] = bounces[i * bounces.size() / some.size()];
  return some;
}

ParallaxSphere fit_sphere(Bounces bounces, double cut) {
  if (bounces.empty()) return {};
  const ParallaxSphere met = sphere_of(bounces, cut);
  ParallaxSphere best = met;
  best.inverse_distance = 0;
  const double reach = farthest(bounces, met);
  if (!(reach > 0 && met.inverse_distance > 0)) return best;
  const auto some = subset_of_bounces(bounces, kTried);
  double most = 0;
  for (const float factor : kInverseDistances) {
    ParallaxSphere sphere = met;
    sphere.inverse_distance =
        std::min(factor * met.inverse_distance, static_cast<float>(kMaxOffset / reach));
    double squares = 0;
    for (const double contribution : direction_bins(some, sphere, cut))
      squares += contribution * contribution;
    if (squares <= most) continue;
    most = squares;
    best = sphere;
  }
  return best;
}

DirectionBins smoothed(const DirectionBins& bins) {
  static const Blur blur = make_blur();
  DirectionBins out{};
  for (uint32_t b = 0; b < kGuidingBins; ++b)
    if (bins[b] > 0)
      for (const auto& [other, share] : blur[b]) out[other] += share * bins[b];
  return out;
}

}  // namespace wavecomb
