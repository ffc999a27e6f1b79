// SPDX-License-Identifier: Apache-2.0
/// Efficiency-aware Russian roulette, where the survival probability depends on the expected
/// contribution and the expected cost.
///
/// A path that survives with probability q, and is then weighted by 1 / q, adds T^2 X / q to the
/// second moment of its pixel and c q to its cost. T is the throughput at the vertex; X and c are
/// the second moment and the cost of the bounce and the rest of the path, for a throughput of 1.
/// Efficiency is greatest for
///   q = T / I sqrt(X / c) sqrt(C / V)
/// with I the brightness of the image at the pixel, C the mean cost of a camera path and V its
/// variance over I^2 (Rath et al., "EARS", SIGGRAPH 2022, eq. 29). V is estimated as the number of
/// samples times the variance of their mean. Stratified samples make V smaller, so the noise of
/// roulette has a larger relative effect. Each region stores sqrt(X C / (c V)).
#pragma once

#include <cstdint>

#include "wavecomb/core/math.h"
#include "wavecomb/guiding/lookup.h"

namespace wavecomb {

/// Minimum survival probability.
inline constexpr float kMinSurvival = 0.1f;

/// Returns the survival probability of a path in a region with training samples. `share` is the
/// throughput divided by the brightness of the image at the pixel.
template <typename F>
inline F efficient_survival(const GuidingLookup<F>& guiding, const F& share) {
  return clamp(F(share * guiding.survival), F(kMinSurvival), F(1.f));
}

/// Training sample of roulette: a bounce, which may or may not have contributed light.
struct BounceSample {
  uint64_t position_key;  ///< bounce_position_key
  float value;            ///< TrainingRecord::value, or 0 if the bounce contributed no light
  float squared;          ///< second moment of the bounce under roulette
  float cost;             ///< expected cost of the bounce and the rest of the path, in rays
};

/// Expected cost and variance of a camera path under roulette, or their means over paths.
struct PathStatistics {
  double cost = 0;  ///< expected cost of a path, in rays
  /// In the statistics of a single path, this member is the variance that roulette adds. In the
  /// mean over paths, it is the total variance of a path, divided by the squared brightness of the
  /// image.
  double variance = 0;
  /// Expected number of vertices at which roulette is used, and expected number of these at which
  /// the path survives.
  double vertices = 0, survivors = 0;
};

}  // namespace wavecomb
