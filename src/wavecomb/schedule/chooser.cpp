// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/schedule/chooser.h"

#include <limits>

namespace wavecomb {

size_t Chooser::choose(uint32_t depth, std::span<const Work> work) {
  ++calls_;
  size_t best = 0;
  double least = std::numeric_limits<double>::infinity();
  for (size_t arm = 0; arm < arms_; ++arm) {
    const Stat& s = stat(depth, arm);
    if (s.tries < kFirstTries) return arm;
    const double ns = work[arm].packets * s.packet_ns + work[arm].records * s.record_ns;
    if (ns < least) {
      least = ns;
      best = arm;
    }
  }
  if (calls_ % kRetryPeriod != 0) return best;
  // A turn for one of the others, if it is nearly as good.
  const size_t other = (calls_ / kRetryPeriod) % arms_;
  const Stat& s = stat(depth, other);
  const double ns = work[other].packets * s.packet_ns + work[other].records * s.record_ns;
  return ns < least * kNearlyAsGood ? other : best;
}

void Chooser::learn(uint32_t depth, size_t arm, const Work& work, double run_ns,
                    double prepare_ns) {
  ++used_[arm];
  if (work.packets <= 0 || work.records <= 0) return;
  Stat& s = stat(depth, arm);
  const double packet_ns = run_ns / work.packets, record_ns = prepare_ns / work.records;
  // The first measurement meets cold caches; it is replaced by the second.
  const double weight = s.tries < kFirstTries ? 1.0 : kWeight;
  s.packet_ns += weight * (packet_ns - s.packet_ns);
  s.record_ns += weight * (record_ns - s.record_ns);
  ++s.tries;
}

}  // namespace wavecomb
