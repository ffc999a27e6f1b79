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

/// Candidates for the inverse radius, relative to the inverse of the harmonic mean distance.
constexpr std::array<float, 4> kNearnesses = {0.f, 0.5f, 1.f, 1.5f};
/// Number of bounces with which the candidates are compared.
constexpr size_t kTried = 2048;
/// Standard deviation of the blur in radians, and its cutoff in standard deviations.
constexpr double kBlur = 0.09, kBlurReach = 3;

Vec3<float> vector_of(const float (&v)[3]) {
  return {v[0], v[1], v[2]};
}

uint32_t bin_of(const TrainingRecord& r, const GuideSphere& sphere) {
  const Vec3<float> offset =
      sphere_offset<float>(vector_of(r.p), vector_of(sphere.middle), sphere.nearness);
  const Vec2<float> at =
      octahedral_point<float>(seen_from_middle<float>(offset, vector_of(r.wi)).w);
  const auto step = [](float x) {
    return std::min(static_cast<uint32_t>(x * kGuideSide), kGuideSide - 1);
  };
  return step(at.y) * kGuideSide + step(at.x);
}

/// Computes the mean position of the bounces and the mean inverse distance of their hits, weighted
/// by contribution. No bounce has a weight above `cut`.
GuideSphere sphere_of(Bounces bounces, double cut) {
  double middle[3] = {}, nearness = 0, weight = 0;
  for (const TrainingRecord* r : bounces) {
    for (int i = 0; i < 3; ++i) middle[i] += double{r->p[i]};
    if (r->nearness < 0) continue;
    const double value = std::min(double{r->value}, cut);
    nearness += value * double{r->nearness};
    weight += value;
  }
  GuideSphere sphere;
  for (int i = 0; i < 3; ++i)
    sphere.middle[i] = static_cast<float>(middle[i] / static_cast<double>(bounces.size()));
  if (weight > 0 && std::isfinite(nearness))
    sphere.nearness = static_cast<float>(nearness / weight);
  return sphere;
}

double farthest(Bounces bounces, const GuideSphere& sphere) {
  double most = 0;
  for (const TrainingRecord* r : bounces) {
    double squared = 0;
    for (int i = 0; i < 3; ++i) {
      const double d = double{r->p[i]} - double{sphere.middle[i]};
      squared += d * d;
    }
    most = std::max(most, squared);
  }
  return std::sqrt(most);
}

/// For each bin, the bins that receive its weight after the blur, with their fractions.
using Blur = std::array<std::vector<std::pair<uint32_t, double>>, kGuideBins>;

Blur make_blur() {
  std::array<Vec3<float>, kGuideBins> directions;
  for (uint32_t b = 0; b < kGuideBins; ++b) directions[b] = bin_direction(b);
  Blur blur;
  const double least = std::cos(kBlurReach * kBlur);
  for (uint32_t b = 0; b < kGuideBins; ++b) {
    double sum = 0;
    for (uint32_t other = 0; other < kGuideBins; ++other) {
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
  constexpr float width = 1.f / static_cast<float>(kGuideSide);
  return octahedral_direction<float>((static_cast<float>(bin % kGuideSide) + 0.5f) * width,
                                     (static_cast<float>(bin / kGuideSide) + 0.5f) * width);
}

DirectionBins direction_bins(Bounces bounces, const GuideSphere& sphere, double cut) {
  DirectionBins bins{};
  for (const TrainingRecord* r : bounces)
    bins[bin_of(*r, sphere)] += std::min(double{r->value}, cut);
  return bins;
}

std::vector<const TrainingRecord*> some_bounces(Bounces bounces, size_t count) {
  std::vector<const TrainingRecord*> some(std::min(bounces.size(), count));
  for (size_t i = 0; i < some.size(); ++i) some[i] = bounces[i * bounces.size() / some.size()];
  return some;
}

GuideSphere fit_sphere(Bounces bounces, double cut) {
  if (bounces.empty()) return {};
  const GuideSphere met = sphere_of(bounces, cut);
  GuideSphere best = met;
  best.nearness = 0;
  const double reach = farthest(bounces, met);
  if (!(reach > 0 && met.nearness > 0)) return best;
  const auto some = some_bounces(bounces, kTried);
  double most = 0;
  for (const float factor : kNearnesses) {
    GuideSphere sphere = met;
    sphere.nearness = std::min(factor * met.nearness, static_cast<float>(kMostOffset / reach));
    double squares = 0;
    for (const double brought : direction_bins(some, sphere, cut)) squares += brought * brought;
    if (squares <= most) continue;
    most = squares;
    best = sphere;
  }
  return best;
}

DirectionBins smoothed(const DirectionBins& bins) {
  static const Blur blur = make_blur();
  DirectionBins out{};
  for (uint32_t b = 0; b < kGuideBins; ++b)
    if (bins[b] > 0)
      for (const auto& [other, share] : blur[b]) out[other] += share * bins[b];
  return out;
}

}  // namespace wavecomb
