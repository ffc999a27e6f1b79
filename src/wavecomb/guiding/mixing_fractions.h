// SPDX-License-Identifier: Apache-2.0
/// Second moments of mixtures of BSDF and guiding field, estimated for several mixing fractions.
#pragma once

#include <array>
#include <cstddef>

#include "wavecomb/guiding/training_sample.h"

namespace wavecomb {

/// Candidate fractions of bounces that the BSDF samples; the last fraction, 1, means no guiding.
inline constexpr std::array<float, 8> kBsdfShares = {0.25f, 0.35f, 0.45f, 0.55f,
                                                     0.65f, 0.75f, 0.85f, 1.f};

/// Computes p / (a p_bsdf + (1 - a) p_guide) of a bounce for each a in kBsdfShares. The results are
/// 0 if the record contains no density of a guiding field.
using ShareRatios = std::array<float, kBsdfShares.size()>;
ShareRatios share_ratios(const TrainingRecord& r);

/// Second moments S(a) for each a in kBsdfShares (field.h), and the number of bounces.
struct ShareMoments {
  std::array<double, kBsdfShares.size()> sums{};
  double count = 0;

  /// Adds a bounce, whose `value` the caller has clamped. Ignores bounces whose record contains no
  /// density of a guiding field.
  void add(const ShareRatios& ratios, double value) {
    if (!(ratios[0] > 0)) return;
    const double squared = value * value;
    for (size_t i = 0; i < sums.size(); ++i) sums[i] += squared * double{ratios[i]};
    count += 1;
  }
  /// Adds the moments and the count of `other`, multiplied by `factor`.
  void add(const ShareMoments& other, double factor);
  /// Returns the index in `kBsdfShares` of the fraction with the smallest second moment. Returns
  /// the index of fraction 1 (no guiding) unless guiding reduces the second moment below
  /// `kWorthwhile` times the moment without guiding.
  size_t best() const;
  static constexpr double kWorthwhile = 0.95;
};

}  // namespace wavecomb
