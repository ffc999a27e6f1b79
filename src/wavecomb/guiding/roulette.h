// SPDX-License-Identifier: Apache-2.0
/// Efficiency-aware Russian roulette: survival by expected contribution and cost.
///
/// A path that survives with probability q, and is then weighted by 1 / q, adds T^2 X / q to the
/// second moment of its pixel and c q to its cost. T is the throughput at the vertex; X and c are
/// the second moment and the cost of the bounce and all that follows, for a throughput of 1.
/// Efficiency is greatest for
///   q = T / I sqrt(X / c) sqrt(C / V)
/// with I the brightness of the image at the pixel, C the mean cost of a camera path and V its
/// variance over I^2 (Rath et al., "EARS", SIGGRAPH 2022, eq. 29). V is the variance of the mean of
/// several samples times their number: stratified samples make it smaller, so the noise of roulette
/// weighs more. Each region stores sqrt(X C / (c V)).
#pragma once

#include <cstdint>

#include "wavecomb/core/math.h"
#include "wavecomb/guiding/lookup.h"

namespace wavecomb {

/// Minimum survival probability.
inline constexpr float kMinSurvival = 0.1f;

/// Survival probability in a region with training samples; `share` is T / I.
template <typename F>
inline F efficient_survival(const GuidingLookup<F>& guiding, const F& share) {
  return clamp(F(share * guiding.survival), F(kMinSurvival), F(1.f));
}

/// Training sample of roulette: a bounce with or without contribution.
struct BounceSample {
  uint64_t position_key;  ///< bounce_position_key
  float value;            ///< TrainingRecord::value, or 0 without contribution
  float squared;          ///< second moment under roulette
  float cost;             ///< expected cost of the bounce and all that follows, in rays
};

/// Expected cost and variance of a camera path under roulette, or their means over paths.
struct PathStatistics {
  double cost = 0;  ///< expected cost, in rays
  /// Variance that roulette adds to a path. For the mean over paths: the whole variance divided by
  /// the squared brightness of the image.
  double variance = 0;
  double vertices = 0, survivors = 0;  ///< expected vertices tested by roulette, and survivors
};

}  // namespace wavecomb
