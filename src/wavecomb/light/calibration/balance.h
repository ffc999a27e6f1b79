// SPDX-License-Identifier: Apache-2.0
/// Estimation of the best selection probabilities of lights from samples, for renders that combine
/// light samples and bounces by multiple importance sampling.
///
/// A vertex takes one light sample of density p q over directions, where p is the selection
/// probability of the light and q the density of sampling a direction to it, and one bounce of
/// density b. The balance heuristic combines the light sample and the bounce, with the variance
///
///   sum over lights of  integral g^2 / (p q + b)  -  M^2 - N^2,      g = f |cos| Le V,
///   M = sum of integral g p q / (p q + b),   N = sum of integral g b / (p q + b),
///
/// where M and N are the expected contributions of light samples and of bounces. For probabilities
/// that add up to 1, the variance is least where
///
///   G = E_q[(a / (p + r))^2] - 2 (N - M) E_q[a r / (p + r)^2],   a = g / q, r = b / q,
///
/// has the same value for all lights of nonzero probability p. Then p is proportional to the square
/// root of the second moment for a light that bounces cannot hit, and 0 for a light that bounces
/// sample no worse than light samples.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

namespace wavecomb {

/// Collects light samples and computes the light selection probabilities of least variance. Sums
/// over samples are integers, so that they do not depend on the order of samples.
class LightBalance {
 public:
  /// `shares` are the selection probabilities (> 0) with which the samples are taken, one for each
  /// part of the lights (LightParts). `cells` is the number of groups of similar vertices, for each
  /// of which M and N are estimated separately.
  LightBalance(std::span<const double> shares, size_t cells);

  /// Adds a light sample in part `part` at a vertex in group `cell`. `value` is the contribution of
  /// the light sample times its MIS weight, divided by the brightness of the image around its
  /// pixel, and `weight` is the MIS weight. Ignores values that are not finite. Clamps the sample
  /// so that its value at a selection probability of 1 would be at most kMaxValue.
  void add(size_t cell, size_t part, double value, double weight);

  /// Returns the selection probabilities of least variance. A fraction `kFloor` of the total
  /// probability is not optimised: half of it is distributed evenly and half in proportion to
  /// `power` (> 0, sum 1). Returns `power` if all samples are 0. All probabilities are above 0, and
  /// their sum is 1.
  std::vector<double> shares(std::span<const double> power) const;

  static constexpr double kFloor = 0.1;
  static constexpr double kMaxValue = 16;

 private:
  struct Sample {
    uint32_t cell, part;
    float a, r;
  };
  /// Returns the term G (see the top of this file) of each part at the selection probabilities p.
  std::vector<double> gains(std::span<const double> p) const;

  std::vector<double> first_;
  std::vector<uint64_t> choices_;   ///< by part
  std::vector<uint64_t> vertices_;  ///< by cell
  std::vector<Sample> samples_;     ///< with a contribution
};

/// Calibration of the odds between the two children of a light tree node, from samples of the
/// lights below the node.
class NodeBalance {
 public:
  /// Adds a sample of a light below the node. If `right` is true, the light is below the right
  /// child. `probability` is the selection probability of the sampled child. `value` and `weight`
  /// have the same meaning as in LightBalance::add().
  void add(bool right, double probability, double value, double weight);
  /// Returns the factor on the odds of the right child that minimises the second moment: a power of
  /// sqrt(2) in [1/8, 8], or 1 if there are too few samples.
  float odds() const;

 private:
  static constexpr int kSteps = 6;  ///< in each direction
  static constexpr uint64_t kLeast = 64, kPrior = 16;
  std::array<uint64_t, 2 * kSteps + 1> squares_{};
  uint64_t count_ = 0;
};

}  // namespace wavecomb
