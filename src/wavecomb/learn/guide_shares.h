// SPDX-License-Identifier: Apache-2.0
/// The second moments that mixtures of BSDF and field would have had.
#pragma once

#include <array>
#include <cstddef>

#include "wavecomb/learn/training_record.h"

namespace wavecomb {

/// Shares of the BSDF that are weighed against each other; the last is without guiding.
inline constexpr std::array<float, 8> kBsdfShares = {0.25f, 0.35f, 0.45f, 0.55f,
                                                     0.65f, 0.75f, 0.85f, 1.f};

/// p / (a p_bsdf + (1 - a) p_guide) of a bounce for each of kBsdfShares; 0 where no field was
/// there.
using ShareRatios = std::array<float, kBsdfShares.size()>;
ShareRatios share_ratios(const TrainingRecord& r);

/// S(a) of each of kBsdfShares (guide_field.h), and how many bounces there were.
struct ShareMoments {
  std::array<double, kBsdfShares.size()> sums{};
  double count = 0;

  /// A bounce whose value was cut to `value`.
  void add(const ShareRatios& ratios, double value) {
    if (!(ratios[0] > 0)) return;
    const double squared = value * value;
    for (size_t i = 0; i < sums.size(); ++i) sums[i] += squared * double{ratios[i]};
    count += 1;
  }
  /// Those of `other`, `factor` times.
  void add(const ShareMoments& other, double factor);
  /// Index of the best share: without guiding unless another leaves less than kWorthwhile of its
  /// moment.
  size_t best() const;
  static constexpr double kWorthwhile = 0.95;
};

}  // namespace wavecomb
