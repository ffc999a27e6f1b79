// SPDX-License-Identifier: Apache-2.0
/// How likely a path goes on, by what its bounce is worth.
///
/// With probability q, and counted 1 / q times, what a bounce of a vertex and all that follows
/// brings adds T^2 X / q to the second moment of the pixel, and c q to its cost; T is the
/// throughput at arrival, X the second moment of what bounces bring of a throughput of 1, and c
/// what they cost. Efficiency is greatest where
///   q = T / I sqrt(X / c) sqrt(C / V)
/// with I the brightness of the picture at the pixel, C what a path of the picture costs, and V its
/// variance over I^2 (Rath et al., "EARS", SIGGRAPH 2022, eq. 29). V is that of means of several
/// samples, times how many: well spread samples have a smaller one, and what roulette adds weighs
/// more. A region knows sqrt(X C / (c V)).
#pragma once

#include <cstdint>

#include "wavecomb/core/math.h"
#include "wavecomb/learn/guide.h"

namespace wavecomb {

/// The least probability.
inline constexpr float kLeastSurvival = 0.1f;

/// The probability of going on in a known region; `share`: T / I.
template <typename F>
inline F worthwhile_survival(const GuidePlace<F>& place, const F& share) {
  return clamp(F(share * place.survival), F(kLeastSurvival), F(1.f));
}

/// A bounce, whether it brought light or not.
struct BounceLesson {
  uint64_t place;  ///< bounce_place
  float value;     ///< TrainingRecord::value, or 0
  float squared;   ///< its second moment, with the roulette that is to follow
  float cost;      ///< of it and of all that follows, with that roulette, in rays
};

/// A path of the camera, with that roulette; or the mean of such.
struct PathLesson {
  double cost = 0;  ///< in rays
  /// What roulette adds to it; of the mean, all of it, over the square of the picture's brightness.
  double variance = 0;
  double vertices = 0, survivors = 0;  ///< that roulette looks at, and lets go on
};

}  // namespace wavecomb
