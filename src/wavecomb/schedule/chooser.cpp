// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/schedule/chooser.h"

#include <algorithm>
#include <limits>

namespace wavecomb {

size_t Chooser::choose(uint32_t depth, std::span<const Work> work) {
  const uint32_t calls = ++calls_[row(depth)];
  // Measure every arm a few times first, so that even a short render can compare them.
  size_t newest = 0;
  for (size_t arm = 1; arm < arms_; ++arm)
    if (stat(depth, arm).tries < stat(depth, newest).tries) newest = arm;
  if (stat(depth, newest).tries < kFirstTries) return newest;
  size_t best = 0;
  double least = std::numeric_limits<double>::infinity();
  for (size_t arm = 0; arm < arms_; ++arm) {
    const Stat& s = stat(depth, arm);
    const double ns = work[arm].packets * s.packet_ns + work[arm].records * s.record_ns;
    if (ns < least) {
      least = ns;
      best = arm;
    }
  }
  if (calls % kRetryPeriod != 0) return best;
  // Retry an arm if its predicted time is nearly the best. Any other arm is retried rarely, because
  // its slow measurement may have been caused by other programs on the machine.
  const uint32_t turn = calls / kRetryPeriod;
  const size_t other = turn % arms_;
  if (turn / arms_ % kExplorePeriod == kExplorePeriod - 1) return other;
  const Stat& s = stat(depth, other);
  const double ns = work[other].packets * s.packet_ns + work[other].records * s.record_ns;
  return ns < least * kSimilarCost ? other : best;
}

void Chooser::learn(uint32_t depth, size_t arm, const Work& work, double run_ns,
                    double prepare_ns) {
  ++used_[arm];
  if (work.packets <= 0 || work.records <= 0) return;
  Stat& s = stat(depth, arm);
  const auto update = [&](double& mean, double ns) {
    if (s.tries <= 1)
      mean = ns;  // The first measurement ran with cold caches, so the second replaces it.
    else if (s.tries < kFirstTries)
      mean = std::min(mean, ns);
    else
      mean += kWeight * (std::min(ns, kOutlier * mean) - mean);
  };
  update(s.packet_ns, run_ns / work.packets);
  update(s.record_ns, prepare_ns / work.records);
  ++s.tries;
}

}  // namespace wavecomb
