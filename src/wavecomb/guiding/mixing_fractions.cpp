// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/guiding/mixing_fractions.h"

namespace wavecomb {

ShareRatios share_ratios(const TrainingRecord& r) {
  ShareRatios ratios{};
  if (!(r.guide_pdf > 0)) return ratios;
  for (size_t i = 0; i < ratios.size(); ++i) {
    const float a = kBsdfShares[i];
    ratios[i] = r.pdf / (a * r.bsdf_pdf + (1 - a) * r.guide_pdf);
  }
  return ratios;
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
