// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/learn/guide_shares.h"

namespace wavecomb {

void ShareMoments::add(const TrainingRecord& r, double value) {
  if (!(r.guide_pdf > 0)) return;
  const double moment = value * value * double{r.pdf};
  for (size_t i = 0; i < kBsdfShares.size(); ++i) {
    const double a{kBsdfShares[i]};
    sums[i] += moment / (a * double{r.bsdf_pdf} + (1 - a) * double{r.guide_pdf});
  }
  count += 1;
}

void ShareMoments::add(const ShareMoments& other, double factor) {
  for (size_t i = 0; i < sums.size(); ++i) sums[i] += factor * other.sums[i];
  count += factor * other.count;
}

size_t ShareMoments::best() const {
  size_t best = kBsdfShares.size() - 1;
  double least = kWorthwhile * sums[best];
  for (size_t i = 0; i + 1 < kBsdfShares.size(); ++i)
    if (sums[i] < least) {
      least = sums[i];
      best = i;
    }
  return best;
}

}  // namespace wavecomb
